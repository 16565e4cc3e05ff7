/** The mark of each outcome. Each has its own color and its own shape. */

import { element } from "./dom.js";

/**
 * @typedef {object} Mark
 * @property {string} color - Name of a color of `theme.css`.
 * @property {string} symbol - As Plotly names it.
 * @property {string} glyph - The same shape in text.
 */

/** @type {Record<string, Mark>} */
export const MARKS = {
  bound: { color: "bound", symbol: "circle", glyph: "●" },
  "end-to-end": { color: "end-to-end", symbol: "square", glyph: "■" },
  separated: { color: "separated", symbol: "x", glyph: "✕" },
  equilibrium: { color: "equilibrium", symbol: "triangle-up", glyph: "▲" },
  steady: { color: "steady", symbol: "triangle-down", glyph: "▼" },
  tumbling: { color: "muted", symbol: "cross", glyph: "✚" },
  completed: { color: "completed", symbol: "hexagon-open", glyph: "⬡" },
  undecided: { color: "undecided", symbol: "diamond-open", glyph: "◇" },
  failed: { color: "ink", symbol: "cross-thin-open", glyph: "+" },
};

/**
 * Make a label of an outcome with its mark.
 *
 * @param {string} outcome
 * @returns {HTMLElement}
 */
export function outcomeLabel(outcome) {
  const glyph = element("span", { class: "glyph", "aria-hidden": "true" }, MARKS[outcome].glyph);
  glyph.style.color = `var(--${MARKS[outcome].color})`;
  return element("span", { class: "outcome" }, glyph, outcome);
}
