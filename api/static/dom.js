/** Helpers that make elements. */

/** @typedef {Node | string | null | undefined | Child[]} Child */

/**
 * Make an element.
 *
 * Attributes whose names begin with `on` are listeners. `true` sets an attribute without a value; `false`, null
 * and undefined omit it.
 *
 * @template {keyof HTMLElementTagNameMap} Tag
 * @param {Tag} tag
 * @param {Record<string, unknown>} [attributes]
 * @param {...Child} children
 * @returns {HTMLElementTagNameMap[Tag]}
 */
export function element(tag, attributes = {}, ...children) {
  const made = document.createElement(tag);
  for (const [name, value] of Object.entries(attributes)) {
    if (name.startsWith("on")) {
      made.addEventListener(name.slice(2), /** @type {EventListener} */ (value));
    } else if (value === true) {
      made.setAttribute(name, "");
    } else if (value !== false && value !== null && value !== undefined) {
      made.setAttribute(name, String(value));
    }
  }
  append(made, children);
  return made;
}

/**
 * @param {Element} parent
 * @param {Child[]} children
 */
function append(parent, children) {
  for (const child of children) {
    if (Array.isArray(child)) {
      append(parent, child);
    } else if (child !== null && child !== undefined) {
      parent.append(child);
    }
  }
}

/**
 * Make a table. Each row is a list of cells.
 *
 * Each cell also has the name of its column, which narrow screens show beside it.
 *
 * @param {string} caption
 * @param {string[]} columns
 * @param {Child[][]} rows
 * @returns {HTMLTableElement}
 */
export function table(caption, columns, rows) {
  return element(
    "table",
    {},
    element("caption", { class: "hidden" }, caption),
    element("thead", {}, element("tr", {}, ...columns.map((name) => element("th", { scope: "col" }, name)))),
    element("tbody", {}, ...rows.map((cells) => tableRow(columns, cells))),
  );
}

/**
 * @param {string[]} columns
 * @param {Child[]} cells
 * @returns {HTMLTableRowElement}
 */
export function tableRow(columns, cells) {
  return element(
    "tr",
    {},
    ...cells.map((cell, index) => element("td", { "data-column": columns[index] }, cell)),
  );
}

/**
 * Make a list of names and values. Entries without a value are omitted.
 *
 * @param {[Child, Child][]} entries
 * @returns {HTMLDListElement}
 */
export function definitions(entries) {
  const known = entries.filter(([, value]) => value !== null && value !== undefined);
  return element(
    "dl",
    {},
    ...known.map(([name, value]) => element("div", {}, element("dt", {}, name), element("dd", {}, value))),
  );
}
