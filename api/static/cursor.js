/**
 * The line across the plots at the time that the player shows.
 *
 * It is an element on top of the plots: moving a line of Plotly's lays out all plots again, which is too slow.
 */

import { element } from "./dom.js";

const ROUNDING = 1e-6; // times of frames are in single precision, those of the plots in double

/** @typedef {{l: number, r: number, t: number, b: number}} Margin - Pixels around the plots' axes. */

export class Cursor {
  /**
   * @param {HTMLElement} plots - The element of the plots, which share one axis of time.
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
   * Move the line to a time. It is hidden while the plots do not show this time.
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
