/** An input for a field of a document, as the kind of its value asks for. */

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

  /** What is written in it, as JSON data; text that is no JSON is sent as it is and refused by name. */
  get value() {
    if (this.input.type === "checkbox") {
      return this.input.checked;
    }
    const text = this.input.value.trim();
    if (typeof this.field.value === "string") {
      return text;
    }
    try {
      return JSON.parse(Array.isArray(this.field.value) ? `[${text}]` : text);
    } catch {
      return text;
    }
  }

  get isChanged() {
    return !isSame(this.value, this.field.value);
  }

  /** @param {boolean} isRefused */
  mark(isRefused) {
    this.input.setAttribute("aria-invalid", String(isRefused));
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
  return {
    ...written,
    value: Array.isArray(value) ? value.map((item) => JSON.stringify(item)).join(", ") : value,
  };
}
