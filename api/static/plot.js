/** Plots in the colors and the width of the page. Plotly is loaded when the first plot is drawn. */

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

/** @returns {Promise<any>} */
async function loadPlotly() {
  await import("./plotly/plotly.min.js"); // not a module: it defines one global
  return /** @type {any} */ (globalThis).Plotly;
}

/** An element in which figures are drawn. Each figure replaces the one before. */
export class Plot {
  /** @type {(() => Figure) | null} */
  #figure = null;

  /**
   * @param {HTMLElement} place
   * @param {AbortSignal} signal - Removes the plot when it is aborted.
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
   * Listen for an event of Plotly.
   *
   * @param {string} name - For example `plotly_click`.
   * @param {(event: any) => void} listener
   */
  on(name, listener) {
    this.place.addEventListener("drawn", () => /** @type {any} */ (this.place).on(name, listener), {
      once: true,
    });
  }

  /**
   * Show the label of a point as if the mouse were above it.
   *
   * @param {string} key - The point's custom data.
   */
  async hover(key) {
    const plotly = await loadPlotly();
    const traces = /** @type {any} */ (this.place).data;
    const curveNumber = traces.findIndex((/** @type {any} */ { customdata }) => customdata?.includes(key));
    if (curveNumber >= 0 && !this.signal.aborted) {
      plotly.Fx.hover(this.place, [{ curveNumber, pointNumber: traces[curveNumber].customdata.indexOf(key) }]);
    }
  }

  async unhover() {
    const plotly = await loadPlotly();
    if (!this.signal.aborted) {
      plotly.Fx.hover(this.place, []);
    }
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
  const { fontFamily: family } = window.getComputedStyle(document.body);
  return {
    paper_bgcolor: "rgba(0,0,0,0)",
    plot_bgcolor: "rgba(0,0,0,0)",
    font: { family, size: 13, color: color("ink") },
    hoverlabel: {
      bgcolor: color("surface"),
      bordercolor: color("faint"),
      font: { family, color: color("ink") },
      align: "left",
    },
    modebar: { bgcolor: "rgba(0,0,0,0)", color: color("faint"), activecolor: color("muted") },
    uirevision: "kept", // redrawing keeps the zoom
    dragmode: false, // so that dragging on a touch screen scrolls the page
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
