/** Moves through the runs of a phase diagram by keys: arrows show one run after the other, Enter opens it. */

import { goTo } from "./router.js";

/**
 * @typedef {import("./diagram.js").Mark} Mark
 * @typedef {import("./plot.js").Plot} Plot
 */

export const HINT = "A click on a run opens it. On the diagram, arrow keys go from run to run and Enter opens one.";

export class DiagramKeys {
  /** @type {Mark[]} */
  #marks = [];
  /** @type {string | null} */
  #key = null;

  /**
   * @param {Plot} plot
   * @param {HTMLElement} status - Says in words which run is shown.
   */
  constructor(plot, status) {
    this.plot = plot;
    this.status = status;
    status.textContent = HINT;
    plot.place.addEventListener("keydown", (event) => this.#onKey(event));
    plot.place.addEventListener("blur", () => {
      this.#key = null;
      status.textContent = HINT;
      plot.unhover();
    });
  }

  /** @param {Mark[]} marks */
  follow(marks) {
    this.#marks = [...marks].sort((first, second) => first.x - second.x || first.y - second.y);
  }

  get #mark() {
    return this.#marks.find(({ key }) => key === this.#key);
  }

  /** @param {KeyboardEvent} event */
  #onKey(event) {
    const moves = /** @type {Record<string, () => Mark | undefined>} */ ({
      ArrowUp: () => this.#above(1),
      ArrowDown: () => this.#above(-1),
      ArrowRight: () => this.#beside(1),
      ArrowLeft: () => this.#beside(-1),
      Home: () => this.#marks[0],
      End: () => this.#marks[this.#marks.length - 1],
    });
    if (event.key === "Enter" && this.#key) {
      goTo(`/runs/${this.#key}`);
    } else if (event.key in moves && this.#marks.length > 0) {
      event.preventDefault();
      this.#show(this.#mark ? moves[event.key]() ?? this.#mark : this.#marks[0]);
    }
  }

  /** @param {number} step */
  #above(step) {
    const same = this.#marks.filter(({ x }) => x === this.#mark?.x);
    return same[same.findIndex(({ key }) => key === this.#key) + step];
  }

  /** @param {number} step */
  #beside(step) {
    const { x, y } = /** @type {Mark} */ (this.#mark);
    const all = [...new Set(this.#marks.map((mark) => mark.x))];
    const there = this.#marks.filter((mark) => mark.x === all[all.indexOf(x) + step]);
    return there.sort((first, second) => Math.abs(first.y - y) - Math.abs(second.y - y))[0];
  }

  /** @param {Mark} mark */
  #show(mark) {
    this.#key = mark.key;
    this.status.textContent = mark.text.join(", ");
    this.plot.hover(mark.key);
  }
}
