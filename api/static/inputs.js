/** Inputs for the fields of a document, according to the types of their values. */

import { element } from "./dom.js";
import { isSame } from "./fields.js";

/** @typedef {import("./fields.js").Field} Field */

/** A labeled input that knows whether its value has been changed. */
export class FieldInput {
  /** @param {Field} field */
  constructor(field) {
    this.field = field;
    const id = `field-${field.path}`;
    this.input = element("input", { id, ...attributesFor(field.value) });
    this.element = element(
      "div",
      { class: "field" },
      element("label", { for: id }, field.label),
      this.input,
      field.label === field.path ? null : element("code", { class: "path" }, field.path),
    );
  }

  /** The value as JSON data. Text that is not JSON is sent unchanged, and the service names the invalid field. */
  get value() {
    if (this.input.type === "checkbox") {
      return this.input.checked;
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

  get isChanged() {
    return !isSame(this.value, this.field.value);
  }

  /** @param {boolean} isRefused */
  mark(isRefused) {
    this.input.setAttribute("aria-invalid", String(isRefused));
  }
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
