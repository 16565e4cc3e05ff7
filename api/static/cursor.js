/**
 * The line across the plots at the time that the player shows.
 *
 * An element of its own: Plotly would lay all plots out anew to move a line, which is too slow to play by.
 */

import { element } from "./dom.js";

const ROUNDING = 1e-6; // times of frames come in single precision, those of the plots in double

/** @typedef {{l: number, r: number, t: number, b: number}} Margin - Pixels around the plots' axes. */

export class Cursor {
  /**
   * @param {HTMLElement} plots - Where Plotly draws, all plots with one axis of time.
   * @param {Margin} margin
   */
  constructor(plots, margin) {
    this.plots = plots;
    this.margin = margin;
    this.line = element("div", { class: "cursor", hidden: true });
    this.line.style.top = `${margin.t}px`;
    this.line.style.bottom = `${margin.b}px`;
  }

  /**
   * Stand at a time, as far as the plots have been drawn and show it.
   *
   * @param {number} time
   */
  show(time) {
    const range = /** @type {any} */ (this.plots).layout?.xaxis?.range;
    if (range === undefined) {
      return;
    }
    const share = (time - range[0]) / (range[1] - range[0]);
    const width = this.plots.clientWidth - this.margin.l - this.margin.r;
    this.line.hidden = share < -ROUNDING || share > 1 + ROUNDING;
    this.line.style.transform = `translateX(${this.margin.l + share * width}px)`;
  }
}
