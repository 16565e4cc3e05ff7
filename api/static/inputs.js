/** Inputs for the fields of a document, according to the types of their values. */

import { element } from "./dom.js";
import { isSame } from "./fields.js";

/**
 * @typedef {import("./fields.js").Field} Field
 * @typedef {import("./fields.js").FormDocument} FormDocument
 * @typedef {import("./fields.js").Union} Union
 */

const NONE = "none";

/** A labeled input that knows whether its value has been changed, and shows why it is refused. */
export class FieldInput {
  /** @param {Field} field */
  constructor(field) {
    this.field = field;
    const id = `field-${field.path}`;
    const described = { "aria-describedby": `${id}-help ${id}-refusal` };
    this.input = field.choices
      ? menu(field.choices, field.value, { id, ...described })
      : element("input", { id, ...described, ...attributesFor(field.value) });
    this.refusal = element("p", { id: `${id}-refusal`, class: "refusal", hidden: true });
    this.element = element(
      "div",
      { class: "field" },
      labelOf(id, field.label, field.unit),
      this.input,
      this.refusal,
      helpOf(id, field.help, field.path),
    );
  }

  /** The value as JSON data. Text that is not JSON is sent unchanged, and the service names the invalid field. */
  get value() {
    if (this.input.type === "checkbox") {
      return /** @type {HTMLInputElement} */ (this.input).checked;
    }
    const text = this.input.value.trim();
    if (typeof this.field.value === "string") {
      return text;
    }
    if (this.field.value === null && text === "") {
      return null;
    }
    return parsed(text, Array.isArray(this.field.value));
  }

  /** @returns {[string, unknown][]} Path and value, if it has been changed. */
  get changes() {
    return isSame(this.value, this.field.value) ? [] : [[this.field.path, this.value]];
  }

  /** All inputs, which is this one. @returns {FieldInput[]} */
  get inputs() {
    return [this];
  }

  /** @param {string} reason - Why the value is refused; empty if it is not. */
  mark(reason) {
    this.input.setAttribute("aria-invalid", String(reason !== ""));
    this.refusal.textContent = reason;
    this.refusal.hidden = reason === "";
    const part = this.element.closest("details");
    if (reason && part) {
      part.open = true;
    }
  }
}

/** A menu of the kinds that a table may be, and inputs for the fields of the chosen kind. */
export class UnionInput {
  /** @type {FieldInput[]} */
  inputs = [];

  /**
   * @param {Union} union
   * @param {FormDocument} form
   */
  constructor(union, form) {
    this.union = union;
    this.form = form;
    const id = `field-${union.path}`;
    const kinds = union.isOptional ? [NONE, ...union.kinds] : union.kinds;
    this.menu = menu(kinds, union.value?.kind ?? NONE, {
      id,
      "aria-describedby": `${id}-help`,
      onchange: () => this.#showFields(),
    });
    this.element = element("div", { class: "union" });
    this.head = element(
      "div",
      { class: "field" },
      labelOf(id, union.label, ""),
      this.menu,
      helpOf(id, union.help, union.path),
    );
    this.#showFields();
  }

  /** The table of the chosen kind before its fields are changed. */
  get #table() {
    const { path, value } = this.union;
    if (this.menu.value === NONE) {
      return null;
    }
    return this.#isKept ? value : this.form.schema.table(path, this.menu.value, value);
  }

  get #isKept() {
    return this.menu.value === (this.union.value?.kind ?? NONE);
  }

  #showFields() {
    const table = this.#table;
    const fields = table ? this.form.fieldsOf(this.union.path, table) : [];
    this.inputs = fields.map((field) => new FieldInput(field));
    this.element.replaceChildren(this.head, ...this.inputs.map((input) => input.element));
  }

  /** @returns {[string, unknown][]} Paths and values: of single fields, or the whole table if its kind is another one. */
  get changes() {
    if (this.#isKept) {
      return this.inputs.flatMap((input) => input.changes);
    }
    const table = this.#table;
    const values = this.inputs.map(({ field, value }) => [field.path.slice(this.union.path.length + 1), value]);
    return [[this.union.path, table && { ...table, ...Object.fromEntries(values) }]];
  }
}

/**
 * @param {string} id - Of the input.
 * @param {string} label
 * @param {string} unit
 */
function labelOf(id, label, unit) {
  return element("label", { for: id }, label, unit ? element("span", { class: "unit" }, ` in ${unit}`) : null);
}

/**
 * @param {string} id - Of the input.
 * @param {string} help
 * @param {string} path
 */
function helpOf(id, help, path) {
  return element("p", { id: `${id}-help`, class: "help" }, help, " ", element("code", { class: "path" }, path));
}

/**
 * @param {string[]} choices
 * @param {unknown} chosen
 * @param {Record<string, unknown>} attributes
 */
function menu(choices, chosen, attributes) {
  const options = choices.map((choice) =>
    element("option", { value: choice, selected: choice === chosen }, choice),
  );
  return element("select", attributes, ...options);
}

/** An input for changes of any field, one per line: `path = value`. The document may lack the field. */
export class FurtherChanges {
  constructor() {
    this.input = element("textarea", {
      id: "further",
      rows: 3,
      spellcheck: "false",
      autocomplete: "off",
      placeholder: "adhesion.cutoff = 1.2\nvesicles.0.length = 7.5",
    });
    this.element = element(
      "div",
      { class: "field further" },
      element("label", { for: "further" }, "any other change: path = value, one per line"),
      this.input,
    );
  }

  /** @returns {[string, unknown][]} Paths and values. */
  get changes() {
    const lines = this.input.value.split("\n").filter((line) => line.trim());
    return lines.map((line) => {
      const [, path, value] = /** @type {string[]} */ (/^([^=]*)=?(.*)$/.exec(line));
      return [path.trim(), parsed(value.trim())];
    });
  }
}

/**
 * Parse JSON. Text that is not JSON is returned unchanged.
 *
 * @param {string} text
 * @param {boolean} [isList] - Whether the text is the inside of a list, without brackets.
 * @returns {unknown}
 */
function parsed(text, isList = false) {
  try {
    return JSON.parse(isList ? `[${text}]` : text);
  } catch {
    return text;
  }
}

/** @param {unknown} value */
function attributesFor(value) {
  if (typeof value === "boolean") {
    return { type: "checkbox", checked: value };
  }
  const written = { type: "text", autocomplete: "off", spellcheck: "false" };
  if (typeof value === "number") {
    return { ...written, inputmode: "decimal", value };
  }
  if (value === null) {
    return { ...written, placeholder: "none" };
  }
  return {
    ...written,
    value: Array.isArray(value) ? value.map((item) => JSON.stringify(item)).join(", ") : value,
  };
}
