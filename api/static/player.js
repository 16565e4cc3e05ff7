/** Plays a run: a canvas, and controls for mouse, touch and keyboard. */

import { element } from "./dom.js";
import { number } from "./format.js";
import { MembraneCanvas } from "./membranes.js";
import { THEME_CHANGED } from "./theme.js";

/** @typedef {import("./frames.js").Frames} Frames */

const SPEEDS = [1, 2, 5, 10, 20, 50]; // units of time per second
const USUAL_SECONDS = 20; // for playing a whole run at the initial speed
const TIME_CHANGED = "timechanged";
const RESTED = "rested";

/** A player. It dispatches `timechanged` when it shows another time, and `rested` when it stops at one. */
export class Player extends EventTarget {
  /** @type {number | null} */
  #lastTick = null;

  /**
   * @param {Frames} frames
   * @param {import("./flow.js").ImposedFlow | null} flow
   * @param {any} scene - Of the run.
   * @param {import("./units.js").Units} units - Of the scene.
   * @param {AbortSignal} signal - Stops the player when it is aborted.
   */
  constructor(frames, flow, scene, units, signal) {
    super();
    this.frames = frames;
    this.units = units;
    this.signal = signal;
    this.time = frames.states[0].time;
    const wanted = frames.end / USUAL_SECONDS;
    this.speed = SPEEDS.find((speed) => speed >= wanted) ?? SPEEDS[SPEEDS.length - 1];

    const canvas = element("canvas", { role: "img", tabindex: 0 });
    this.canvas = canvas;
    this.membranes = new MembraneCanvas(canvas, frames, flow, scene, units);
    this.button = element("button", { class: "primary play", onclick: () => this.#toggle() });
    this.clock = element("output", { class: "clock" });
    this.scrubber = element("input", {
      type: "range",
      min: this.time,
      max: frames.end,
      step: "any",
      "aria-label": "Time",
      oninput: () => this.seek(Number(this.scrubber.value)),
      onpointerdown: () => this.rest(this.time),
      onchange: () => this.rest(Number(this.scrubber.value)),
    });
    this.element = element(
      "div",
      { class: "player" },
      canvas,
      this.#controls(),
      element(
        "p",
        { class: "note" },
        "Space plays and stops; the arrow keys step through the recorded frames.",
      ),
    );
    this.element.addEventListener("keydown", (event) => this.#onKey(event));
    document.addEventListener("keydown", (event) => this.#onSpace(event), { signal });
    // After a click keys are for the player again, and not for the button.
    this.element.addEventListener("click", ({ target, detail }) => {
      if (detail > 0 && target instanceof HTMLButtonElement) {
        canvas.focus({ preventScroll: true });
      }
    });
    window.addEventListener(THEME_CHANGED, () => this.#onTheme(), { signal });
    const observer = new ResizeObserver(() => this.#draw());
    observer.observe(canvas);
    signal.addEventListener("abort", () => {
      this.#lastTick = null;
      observer.disconnect();
    });
    this.#label();
    this.seek(this.time);
  }

  #controls() {
    const speeds = element(
      "select",
      { "aria-label": "Units of time per second", onchange: () => (this.speed = Number(speeds.value)) },
      ...SPEEDS.map((speed) =>
        element("option", { value: speed, selected: speed === this.speed }, `${speed} / s`),
      ),
    );
    return element(
      "div",
      { class: "controls" },
      this.button,
      element("button", { "aria-label": "Previous frame", onclick: () => this.step(-1) }, "‹"),
      element("button", { "aria-label": "Next frame", onclick: () => this.step(1) }, "›"),
      this.scrubber,
      this.clock,
      speeds,
    );
  }

  /**
   * Call a function with the time, now and after each change.
   *
   * @param {(time: number) => void} listener
   */
  onTime(listener) {
    this.addEventListener(TIME_CHANGED, () => listener(this.time));
    listener(this.time);
  }

  /**
   * Call a function with the time whenever the player stops.
   *
   * @param {(time: number) => void} listener
   */
  onRest(listener) {
    this.addEventListener(RESTED, () => listener(this.time));
  }

  get isPlaying() {
    return this.#lastTick !== null;
  }

  /**
   * Show a time.
   *
   * @param {number} time
   */
  seek(time) {
    this.time = Math.min(Math.max(time, this.frames.states[0].time), this.frames.end);
    this.scrubber.value = String(this.time);
    this.scrubber.setAttribute("aria-valuetext", `time ${number(this.time)}`);
    this.clock.textContent = `t = ${this.units.both("time", this.time, (time) => time.toFixed(1))}`;
    this.#draw();
    this.dispatchEvent(new Event(TIME_CHANGED));
  }

  play() {
    if (this.time >= this.frames.end) {
      this.seek(this.frames.states[0].time);
    }
    this.#lastTick = performance.now();
    this.#label();
    requestAnimationFrame((now) => this.#tick(now));
  }

  /**
   * Stop playing, and stay at a time.
   *
   * @param {number} time
   */
  rest(time) {
    this.#lastTick = null;
    this.#label();
    this.seek(time);
    this.dispatchEvent(new Event(RESTED));
  }

  /**
   * Show another recorded frame.
   *
   * @param {number} frames - How many frames later.
   */
  step(frames) {
    const { states } = this.frames;
    const index = this.frames.indexAt(this.time) + frames;
    this.rest(states[Math.min(Math.max(index, 0), states.length - 1)].time);
  }

  /** @param {number} now - Milliseconds. */
  #tick(now) {
    if (this.#lastTick === null) {
      return;
    }
    const seconds = Math.max(now - this.#lastTick, 0) / 1000;
    this.#lastTick = now;
    this.seek(this.time + this.speed * seconds);
    if (this.time >= this.frames.end) {
      this.rest(this.time);
      return;
    }
    requestAnimationFrame((next) => this.#tick(next));
  }

  #toggle() {
    if (this.isPlaying) {
      this.rest(this.time);
    } else {
      this.play();
    }
  }

  #label() {
    this.button.textContent = this.isPlaying ? "Pause" : "Play";
  }

  /**
   * Play or stop wherever the focus is, unless the space is for what has it: text, a button, a menu.
   *
   * @param {KeyboardEvent} event
   */
  #onSpace(event) {
    const takesSpace = "button, select, summary, textarea, input:not([type=range]), dialog *";
    if (event.key === " " && !(event.target instanceof Element && event.target.matches(takesSpace))) {
      event.preventDefault();
      this.#toggle();
    }
  }

  /** @param {KeyboardEvent} event */
  #onKey(event) {
    const takesKeys = event.target instanceof HTMLButtonElement || event.target instanceof HTMLSelectElement;
    /** @type {Record<string, () => void>} */
    const actions = {
      ArrowLeft: () => this.step(-1),
      ArrowRight: () => this.step(1),
      Home: () => this.rest(this.frames.states[0].time),
      End: () => this.rest(this.frames.end),
    };
    if (event.key in actions && !takesKeys) {
      event.preventDefault();
      actions[event.key]();
    }
  }

  #onTheme() {
    this.membranes.takeColors();
    this.#draw();
  }

  #draw() {
    // A canvas that is not on the page yet has no size. The observer draws it when it gets one.
    if (this.canvas.clientWidth > 0) {
      this.membranes.draw(this.frames.at(this.time));
    }
  }
}
