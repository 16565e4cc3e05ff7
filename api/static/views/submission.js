/** A form that submits a preset, or the scene of a run, with changed parameters. */

import { get, getAll, post } from "../api.js";
import { element } from "../dom.js";
import { fieldsOf } from "../fields.js";
import { number, words } from "../format.js";
import { FieldInput, FurtherChanges } from "../inputs.js";
import { kindNamed, kinds, sceneIn } from "../kinds.js";
import { alertAbout, messageOf } from "../problems.js";
import { goTo } from "../router.js";

/**
 * @typedef {object} Template - What the form submits, apart from the changes.
 * @property {string} title
 * @property {any} document
 * @property {string} kind - Which kind of question it asks.
 * @property {{preset: string} | {scene: any}} origin
 */

const USUAL_PRESET = "critical-hamaker";
const QUIET_MILLISECONDS = 250; // without a change, before the cost is requested

/** @param {import("../router.js").Place} place */
export async function showSubmission({ content, query, signal }) {
  document.title = "New job – Vesicle ensemble";
  const presets = await getAll("/presets", signal);
  const template = await templateOf(query, presets, signal);
  content.replaceChildren(
    element("div", { class: "heading" }, element("h1", {}, "New job")),
    element(
      "div",
      { class: "columns submission" },
      new SubmissionForm(template, signal).element,
      choices(presets, "preset" in template.origin ? template.origin.preset : null),
    ),
  );
  content.querySelector(".shelf [aria-current]")?.scrollIntoView({ block: "nearest", inline: "center" });
}

/**
 * @param {URLSearchParams} query
 * @param {any[]} presets
 * @param {AbortSignal} signal
 * @returns {Promise<Template>}
 */
async function templateOf(query, presets, signal) {
  const run = query.get("run");
  if (run) {
    const { scene } = await get(`/runs/${run}`, signal);
    return { title: `Scene of run ${run.slice(0, 8)}`, document: scene, kind: "scene", origin: { scene } };
  }
  const wanted = query.get("preset") ?? USUAL_PRESET;
  const preset = presets.find(({ name }) => name === wanted) ?? presets[0];
  const { name, document, kind } = preset;
  return { title: words(name), document, kind, origin: { preset: name } };
}

/**
 * @param {any[]} presets
 * @param {string | null} current
 */
function choices(presets, current) {
  const shelf = (/** @type {import("../kinds.js").Kind} */ wanted) => [
    element("h2", {}, wanted.title),
    element(
      "ul",
      {},
      ...presets
        .filter(({ kind }) => kind === wanted.kind)
        .map(({ name, document, estimate }) =>
          element(
            "li",
            {},
            element(
              "a",
              { href: `#/new?preset=${name}`, "aria-current": name === current ? "true" : null },
              element("strong", {}, words(name)),
              element(
                "span",
                {},
                wanted.has_many_runs ? `up to ${estimate.runs} runs` : contents(sceneIn(document, wanted)),
              ),
            ),
          ),
        ),
    ),
  ];
  const used = kinds().filter((wanted) => presets.some(({ kind }) => kind === wanted.kind));
  return element("nav", { class: "shelf", "aria-label": "Presets" }, ...used.flatMap(shelf));
}

/** @param {any} scene */
function contents({ vesicles, arrangement, flow }) {
  const count = arrangement?.count ?? vesicles.length;
  return `${count === 1 ? "1 vesicle" : `${count} vesicles`}, ${flow ? flow.kind : "at rest"}`;
}

/** @param {string} id - Also the name of the limit in the document that is sent. */
function limitInput(id) {
  return element("input", { id, type: "number", min: 1, placeholder: "default of the service" });
}

/**
 * @param {string} label
 * @param {HTMLInputElement} input
 */
function labeled(label, input) {
  return element("div", { class: "field" }, element("label", { for: input.id }, label), input);
}

class SubmissionForm {
  /** The same until the form changes, so that a repeated request makes one job. */
  #idempotencyKey = crypto.randomUUID();
  /** @type {number | undefined} */
  #timer;

  /**
   * @param {Template} template
   * @param {AbortSignal} signal
   */
  constructor(template, signal) {
    this.template = template;
    this.signal = signal;
    this.inputs = fieldsOf(template.document, kindNamed(template.kind)).map((field) => new FieldInput(field));
    this.further = new FurtherChanges();
    this.ranks = limitInput("ranks");
    this.seconds = limitInput("seconds");
    this.cost = element("p", { class: "cost", role: "status" });
    this.submit = element("button", { class: "primary" }, "Submit");
    this.element = element(
      "form",
      {
        class: "submit",
        novalidate: true,
        onsubmit: (/** @type {Event} */ event) => this.#send(event),
        oninput: () => this.#onInput(),
      },
      element("h2", {}, template.title),
      ...this.#parameters(),
      element(
        "div",
        { class: "fields" },
        labeled("ranks (processes)", this.ranks),
        labeled("time limit in seconds", this.seconds),
      ),
      element("div", { class: "commit" }, this.cost, this.submit),
    );
    signal.addEventListener("abort", () => window.clearTimeout(this.#timer));
    void this.#estimate();
  }

  /** The inputs of the fields: the principal ones, and all others in a part that is closed at first. */
  #parameters() {
    const [principal, others] = [true, false].map((wanted) =>
      this.inputs.filter((input) => input.field.isPrincipal === wanted).map((input) => input.element),
    );
    return [
      element("div", { class: "fields" }, ...principal),
      element(
        "details",
        {},
        element("summary", {}, `${others.length} more parameters`),
        element("div", { class: "fields" }, ...others),
        this.further.element,
      ),
    ];
  }

  /** The document to send. */
  get submission() {
    const changed = this.inputs
      .filter((input) => input.isChanged)
      .map((input) => [input.field.path, input.value]);
    const limits = [this.ranks, this.seconds]
      .filter((input) => input.value)
      .map((input) => [input.id, Number(input.value)]);
    const changes = Object.fromEntries([...changed, ...this.further.changes]);
    return { ...this.template.origin, ...Object.fromEntries(limits), set: changes };
  }

  #onInput() {
    this.#idempotencyKey = crypto.randomUUID();
    window.clearTimeout(this.#timer);
    this.#timer = window.setTimeout(() => this.#estimate(), QUIET_MILLISECONDS);
  }

  async #estimate() {
    const requested = JSON.stringify(this.submission);
    try {
      const estimate = await post("/estimate", this.submission, { signal: this.signal });
      if (requested === JSON.stringify(this.submission)) {
        this.#showCost(estimate);
      }
    } catch (error) {
      if (!this.signal.aborted && requested === JSON.stringify(this.submission)) {
        this.#refuse(error);
      }
    }
  }

  /**
   * @param {{runs: number, cost: number, maximum: number, recorded: number, most_recorded: number,
   *   memory: number, most_memory: number, accepted: boolean}} estimate
   */
  #showCost({ runs, cost, maximum, recorded, most_recorded, memory, most_memory, accepted }) {
    const count = runs === 1 ? "One run" : `At most ${runs} runs`;
    const share = `cost ${number(cost, 2)} of ${number(maximum, 2)} allowed (points × vesicles × time)`;
    if (recorded > most_recorded) {
      const records = `records ${number(recorded, 2)} numbers of ${number(most_recorded, 2)} allowed`;
      this.cost.textContent = `Too large: ${records}. Raise the intervals of the output.`;
      return;
    }
    if (memory > most_memory) {
      const bytes = `needs ${number(memory / 1e9, 2)} GB of ${number(most_memory / 1e9, 2)} GB allowed`;
      this.cost.textContent = `Too large: ${bytes}. Choose fewer points or vesicles.`;
      return;
    }
    this.cost.textContent = accepted ? `${count}, ${share}.` : `Too large: ${share}.`;
    this.submit.disabled = !accepted;
    this.#mark("");
  }

  /** @param {unknown} error */
  #refuse(error) {
    this.cost.replaceChildren(alertAbout(error));
    this.submit.disabled = true;
    this.#mark(messageOf(error));
  }

  /**
   * Mark the inputs whose paths a message names. The input of all vesicles stands for the field of one of them.
   *
   * @param {string} message
   */
  #mark(message) {
    const general = message.replaceAll(/\.\d+(?=\.)/g, "");
    for (const input of this.inputs) {
      const { path } = input.field;
      input.mark([message, general].some((text) => text.split(/[\s:;]+/).includes(path)));
    }
  }

  /** @param {Event} event */
  async #send(event) {
    event.preventDefault();
    this.submit.disabled = true;
    try {
      const headers = { "Idempotency-Key": this.#idempotencyKey };
      const job = await post("/jobs", this.submission, { headers });
      goTo(`/jobs/${job.id}`);
    } catch (error) {
      this.#refuse(error);
      this.submit.disabled = false;
    }
  }
}
