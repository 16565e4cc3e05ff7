/** Building elements. */

/** @typedef {Node | string | null | undefined | Child[]} Child */

/**
 * Make an element.
 *
 * Names of attributes that begin with `on` take listeners; `true` sets an attribute without a value, and
 * `false`, null and undefined leave it out.
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
 * A table; each row is a list of cells.
 *
 * The names of the columns are repeated with every cell, for screens too narrow to show a row as one.
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
 * A list of names and what belongs to them; entries without a value are left out.
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
