/** A plot that keeps to the page's colors and width.  Plotly itself is loaded when the first one is drawn. */

import { THEME_CHANGED, color } from "./theme.js";

/**
 * @typedef {object} Figure
 * @property {any[]} data - Plotly's traces.
 * @property {any} layout
 */

const CONFIGURATION = {
  displaylogo: false,
  responsive: true,
  modeBarButtonsToRemove: ["select2d", "lasso2d", "autoScale2d", "zoomIn2d", "zoomOut2d"],
  toImageButtonOptions: { format: "svg" },
};

/**
 * Plotly with scatter plots only; `api/README.md` says how this file is built.
 *
 * @returns {Promise<any>}
 */
async function loadPlotly() {
  return (await import("./vendor/plotly.js")).default;
}

/** A place on the page where figures are drawn, one replacing the other. */
export class Plot {
  /** @type {(() => Figure) | null} */
  #figure = null;

  /**
   * @param {HTMLElement} place
   * @param {AbortSignal} signal - Frees what the plot holds.
   */
  constructor(place, signal) {
    this.place = place;
    this.signal = signal;
    window.addEventListener(THEME_CHANGED, () => this.#redraw(), { signal });
    signal.addEventListener("abort", () => this.#free(), { once: true });
  }

  /**
   * @param {() => Figure} figure - Called again when colors change.
   * @returns {Promise<void>}
   */
  async draw(figure) {
    const isFirst = this.#figure === null;
    this.#figure = figure;
    await this.#redraw();
    if (isFirst && !this.signal.aborted) {
      this.place.dispatchEvent(new Event("drawn"));
    }
  }

  /**
   * Listen to an event of Plotly.
   *
   * @param {string} name - Such as `plotly_click`.
   * @param {(event: any) => void} listener
   */
  on(name, listener) {
    this.place.addEventListener("drawn", () => /** @type {any} */ (this.place).on(name, listener), {
      once: true,
    });
  }

  async #redraw() {
    const plotly = await loadPlotly();
    if (this.#figure !== null && !this.signal.aborted) {
      const { data, layout } = this.#figure();
      await plotly.react(this.place, data, { ...pageLayout(), ...layout }, CONFIGURATION);
    }
  }

  async #free() {
    if (this.#figure !== null) {
      (await loadPlotly()).purge(this.place);
    }
  }
}

function pageLayout() {
  return {
    paper_bgcolor: "rgba(0,0,0,0)",
    plot_bgcolor: "rgba(0,0,0,0)",
    font: { family: window.getComputedStyle(document.body).fontFamily, size: 13, color: color("ink") },
    hoverlabel: { bgcolor: color("surface"), bordercolor: color("faint"), font: { color: color("ink") } },
    modebar: { bgcolor: "rgba(0,0,0,0)", color: color("faint"), activecolor: color("muted") },
    uirevision: "kept", // what somebody zoomed to stays when the figure is drawn anew
    dragmode: false, // a finger that drags scrolls the page
  };
}

/**
 * An axis in the page's colors: a thin line with ticks outside and no grid.
 *
 * @param {any} options
 * @returns {any}
 */
export function axis(options) {
  return {
    showgrid: false,
    zeroline: false,
    showline: true,
    linecolor: color("muted"),
    linewidth: 1,
    ticks: "outside",
    ticklen: 5,
    tickcolor: color("muted"),
    automargin: true,
    ...options,
  };
}
