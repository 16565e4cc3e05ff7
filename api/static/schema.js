/** What the service says about the fields of documents: JSON Schema with descriptions, units and allowed values. */

import { get } from "./api.js";

/**
 * @typedef {object} Description
 * @property {string} help - Empty if the field has no description.
 * @property {string} unit - Empty for a number without a unit.
 * @property {string[] | null} choices - All values of a text that has a few; else null.
 */

/** @type {Map<string, Promise<any>>} */
const loaded = new Map();

/**
 * Ask for the schema of the documents of a kind of question, once.
 *
 * @param {string} kind
 * @returns {Promise<Schema>}
 */
export async function schemaOf(kind) {
  // For all views, so it does not end with one of them.
  const document = loaded.get(kind) ?? get(`/kinds/${kind}/schema`, new AbortController().signal);
  loaded.set(kind, document);
  return new Schema(await document);
}

export class Schema {
  /** @param {any} root */
  constructor(root) {
    this.root = root;
  }

  /**
   * Describe the field at a dotted path.
   *
   * @param {string} path
   * @param {any} document - In which tables of a union have their kinds.
   * @returns {Description}
   */
  describe(path, document) {
    const node = this.#at(path, document);
    const choices = this.#alternatives(node).find((each) => each.enum)?.enum ?? null;
    const inside = this.#alternatives(node).flatMap((each) => each.prefixItems?.[0] ?? each.items ?? []);
    const unit = node["x-unit"] ?? [...this.#alternatives(node), ...inside].find((each) => each["x-unit"])?.["x-unit"];
    return { help: plain(node.description ?? ""), unit: inSymbols(unit ?? ""), choices };
  }

  /**
   * The tables of a document that are one of several kinds, or none: flows, potentials.
   *
   * @param {string} prefix - Of the table whose fields are looked at, with its dot; empty for the document.
   * @param {any} document
   * @returns {{path: string, kinds: string[], isOptional: boolean}[]}
   */
  unions(prefix, document) {
    const table = prefix ? this.#at(prefix.slice(0, -1), document) : this.root;
    const properties = this.#alternatives(table).find((each) => each.properties)?.properties ?? {};
    return Object.entries(properties).flatMap(([name, node]) => {
      const all = this.#alternatives(node);
      const kinds = all.map((each) => each.properties?.kind?.const).filter(Boolean);
      const isOptional = all.some((each) => each.type === "null");
      return kinds.length > 0 ? [{ path: prefix + name, kinds, isOptional }] : [];
    });
  }

  /**
   * Return a table of another kind: what it shares with the present one, and defaults; null for what has none.
   *
   * @param {string} path
   * @param {string} kind
   * @param {any} present - The present table; null if there is none.
   */
  table(path, kind, present) {
    const { properties } = this.#alternatives(this.#at(path, {})).find(
      (each) => each.properties?.kind?.const === kind,
    );
    const fields = Object.entries(properties).filter(([name]) => name !== "kind");
    return {
      kind,
      ...Object.fromEntries(
        fields.map(([name, { default: usual }]) => [name, present?.[name] ?? usual ?? null]),
      ),
    };
  }

  /**
   * Return a document with null for every number or text that it does not have and may have, also in tables that it
   * may have, such as the units. The order is that of the model.
   *
   * @param {any} document
   * @param {any} [node]
   * @returns {any}
   */
  completed(document, node = this.root) {
    if (Array.isArray(document)) {
      const items = this.#alternatives(node).find((each) => each.items)?.items;
      return items ? document.map((each) => this.completed(each, items)) : document;
    }
    const properties = this.#table(node, document)?.properties;
    if (document === null && properties && !properties.kind) {
      return Object.fromEntries(Object.keys(properties).map((name) => [name, null]));
    }
    if (!properties || typeof document !== "object" || document === null) {
      return document;
    }
    const names = Object.keys(properties).filter((name) => name in document || this.#isOptional(properties[name]));
    const completed = names.map((name) => [name, this.completed(document[name] ?? null, properties[name])]);
    return { ...Object.fromEntries(completed), ...rest(document, properties) };
  }

  /**
   * Whether there may be no such value or table; a table that is one of several kinds has a menu instead.
   *
   * @param {any} node
   */
  #isOptional(node) {
    const all = this.#alternatives(node);
    return all.some((each) => each.type === "null") && !all.some((each) => each.properties?.kind);
  }

  /**
   * @param {string} path
   * @param {any} document
   */
  #at(path, document) {
    let [node, value] = [this.root, document];
    for (const name of path.split(".")) {
      const list = this.#alternatives(node).find((each) => each.items);
      if (list) {
        node = list.items;
        value = Array.isArray(value) ? value[/^\d+$/.test(name) ? Number(name) : 0] : undefined;
        if (/^\d+$/.test(name)) {
          continue;
        }
      }
      node = this.#table(node, value)?.properties?.[name] ?? {};
      value = value?.[name];
    }
    return this.#resolved(node);
  }

  /**
   * The table among the alternatives; of a union, the one of the kind that a value has.
   *
   * @param {any} node
   * @param {any} value
   */
  #table(node, value) {
    const tables = this.#alternatives(node).filter((each) => each.properties);
    return tables.find((each) => each.properties.kind?.const === value?.kind) ?? tables[0];
  }

  /**
   * @param {any} node
   * @returns {any[]}
   */
  #alternatives(node) {
    const resolved = this.#resolved(node);
    const several = resolved.anyOf ?? resolved.oneOf;
    return several ? several.flatMap((/** @type {any} */ each) => this.#alternatives(each)) : [resolved];
  }

  /** @param {any} node */
  #resolved({ $ref: reference, ...others }) {
    return reference ? { ...this.root.$defs[reference.split("/").pop()], ...others } : others;
  }
}

/**
 * What a document has beside some properties.
 *
 * @param {any} document
 * @param {any} properties
 */
function rest(document, properties) {
  return Object.fromEntries(Object.entries(document).filter(([name]) => !(name in properties)));
}

/**
 * Write a description without the marks of code.
 *
 * @param {string} text
 */
function plain(text) {
  return text.replaceAll("`", "");
}

const SYMBOLS = /** @type {Record<string, string>} */ ({ mu: "μ", kappa: "κ", "-": "⁻" });

/**
 * Write a product of units such as `mu R^3 kappa^-1` with its symbols.
 *
 * @param {string} unit
 */
function inSymbols(unit) {
  return unit
    .replaceAll(/mu|kappa/g, (name) => SYMBOLS[name])
    .replaceAll(/\^(-?)(\d)/g, (_, sign, digit) => (sign && SYMBOLS[sign]) + "⁰¹²³⁴⁵⁶⁷⁸⁹"[Number(digit)])
    .replaceAll(" ", "");
}
