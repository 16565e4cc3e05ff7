/** A form that submits a preset, or what a run, a boundary or a job was made of, with changed parameters. */

import { get, getAll, post } from "../api.js";
import { element } from "../dom.js";
import { FormDocument } from "../fields.js";
import { number, roughly, words } from "../format.js";
import { FieldInput, FurtherChanges, UnionInput } from "../inputs.js";
import { kindNamed, kinds, sceneIn } from "../kinds.js";
import { Problem, alertAbout, messageOf } from "../problems.js";
import { goTo } from "../router.js";
import { schemaOf } from "../schema.js";

/**
 * @typedef {object} Template - What the form submits, apart from the changes.
 * @property {string} title
 * @property {any} document
 * @property {string} kind - Which kind of question it asks.
 * @property {Record<string, any>} origin - The preset or the document, and what a job was allowed to use.
 *
 * @typedef {object} Estimate
 * @property {number} runs
 * @property {number} ranks
 * @property {number | null} seconds
 * @property {number} cost
 * @property {number} maximum
 * @property {number} recorded
 * @property {number} most_recorded
 * @property {number} memory
 * @property {number} most_memory
 * @property {boolean} accepted
 */

const USUAL_PRESET = "critical-hamaker";
const QUIET_MILLISECONDS = 250; // without a change, before the cost is requested

/** @param {import("../router.js").Place} place */
export async function showSubmission({ content, query, signal }) {
  document.title = "New job – Vesicle ensemble";
  const presets = await getAll("/presets", signal);
  const template = await templateOf(query, presets, signal);
  const kind = kindNamed(template.kind);
  const form = new FormDocument(template.document, kind, await schemaOf(template.kind));
  content.replaceChildren(
    element("div", { class: "heading" }, element("h1", {}, "New job")),
    element(
      "div",
      { class: "columns submission" },
      new SubmissionForm(template, form, signal).element,
      choices(presets, template.origin.preset ?? null),
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
  const [run, boundary, job] = ["run", "boundary", "job"].map((name) => query.get(name));
  if (run) {
    const { scene } = await get(`/runs/${run}`, signal);
    return { title: `Scene of run ${run.slice(0, 8)}`, document: scene, kind: "scene", origin: { scene } };
  }
  if (boundary) {
    const { study, name } = await get(`/boundaries/${boundary}`, signal);
    return { title: words(name), document: study, kind: "study", origin: { study } };
  }
  if (job) {
    const [{ name, kind }, origin] = await Promise.all(
      [`/jobs/${job}`, `/jobs/${job}/submission`].map((path) => get(path, signal)),
    );
    return { title: words(name), document: origin[kind], kind, origin };
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
                [
                  wanted.has_many_runs ? `up to ${estimate.runs} runs` : contents(sceneIn(document, wanted)),
                  estimate.seconds === null ? "" : roughly(estimate.seconds),
                ]
                  .filter(Boolean)
                  .join(", "),
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

/**
 * @param {string} id - Also the name of the limit in the document that is sent.
 * @param {number | undefined} value
 */
function limitInput(id, value) {
  return element("input", { id, type: "number", min: 1, value, placeholder: "default of the service" });
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
   * @param {FormDocument} form
   * @param {AbortSignal} signal
   */
  constructor(template, form, signal) {
    this.template = template;
    this.signal = signal;
    this.prefix = form.prefix;
    this.inputs = form.fields.map((field) => new FieldInput(field));
    this.unions = form.unions.map((union) => new UnionInput(union, form));
    this.further = new FurtherChanges();
    this.ranks = limitInput("ranks", template.origin.ranks);
    this.seconds = limitInput("seconds", template.origin.seconds);
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
      element("div", { class: "fields" }, ...principal, ...this.unions.map((union) => union.element)),
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
    const changed = [...this.inputs, ...this.unions].flatMap((input) => input.changes);
    const limits = [this.ranks, this.seconds].map((input) => [input.id, input.value ? Number(input.value) : null]);
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

  /** @param {Estimate} estimate */
  #showCost(estimate) {
    const excess = excessOf(estimate);
    this.cost.textContent = excess ?? `${runsAndTime(estimate)}.`;
    this.submit.disabled = excess !== null;
    this.#mark([]);
  }

  /** @param {unknown} error */
  #refuse(error) {
    const problems = error instanceof Problem ? messageOf(error).split("; ") : [];
    const unplaced = this.#mark(problems);
    const places = problems.length - unplaced.length;
    const shown = problems.length > 0 && places > 0 ? [`See the marked ${places === 1 ? "field" : "fields"}`, ...unplaced] : null;
    this.cost.replaceChildren(alertAbout(shown ? new Error(`${shown.join("; ")}.`) : error));
    this.submit.disabled = true;
  }

  /**
   * Show problems beside the inputs that they name. That of all vesicles stands for the field of one of them.
   *
   * @param {string[]} problems - `path: value — reason`.
   * @returns {string[]} Those that name none of the inputs.
   */
  #mark(problems) {
    const unplaced = new Set(problems);
    const inputs = [...this.inputs, ...this.unions].flatMap((each) => each.inputs);
    const subjects = new Map(problems.map((problem) => [problem, inputs.find(({ field }) => isOf(problem, field.path))]));
    for (const input of inputs) {
      const { path } = input.field;
      const inScene = path.startsWith(this.prefix) ? path.slice(this.prefix.length) : path;
      const named = problems.filter((problem) => [path, inScene].some((name) => isAbout(problem, name)));
      named.forEach((problem) => unplaced.delete(problem));
      const reasons = named.map((problem) => {
        const subject = subjects.get(problem) ?? input;
        return subject === input ? reasonIn(problem, path) : `see ${subject.field.label}`;
      });
      input.mark([...new Set(reasons)].join("; "));
    }
    return [...unplaced];
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

/**
 * Say how many runs a job makes, and how long that takes.
 *
 * @param {Estimate} estimate
 */
function runsAndTime({ runs, ranks, seconds }) {
  const count = runs === 1 ? "One run" : `At most ${runs} runs`;
  const on = ranks === 1 ? "one process" : `${ranks} processes`;
  return seconds === null
    ? `${count} on ${on}; how long ${runs === 1 ? "it takes" : "they take"} is known after the first runs like ` +
        `${runs === 1 ? "it" : "them"}`
    : `${count}, ${roughly(seconds)} on ${on}`;
}

/**
 * Say which limit of the service a job exceeds.
 *
 * @param {Estimate} estimate
 * @returns {string | null} Null if it exceeds none.
 */
function excessOf({ cost, maximum, recorded, most_recorded, memory, most_memory, accepted }) {
  if (recorded > most_recorded) {
    const records = `records ${number(recorded, 2)} numbers of ${number(most_recorded, 2)} allowed`;
    return `Too large: ${records}. Raise the intervals of the output.`;
  }
  if (memory > most_memory) {
    const bytes = `needs ${number(memory / 1e9, 2)} GB of ${number(most_memory / 1e9, 2)} GB allowed`;
    return `Too large: ${bytes}. Choose fewer points or vesicles.`;
  }
  const share = `${number(cost / maximum, 2)} times what is allowed (points × vesicles × time)`;
  return accepted ? null : `Too large: ${share}. Choose fewer values, fewer points or an earlier end.`;
}

/**
 * Whether a problem names the field at a path, or one in its place in a single vesicle.
 *
 * @param {string} problem
 * @param {string} path
 */
function isAbout(problem, path) {
  return readings(problem).some((text) => text.split(/[\s:;,()]+/).includes(path));
}

/**
 * Whether a problem is that of the field at a path, which it begins with.
 *
 * @param {string} problem
 * @param {string} path
 */
function isOf(problem, path) {
  return readings(problem).some((text) => text.startsWith(`${path}:`));
}

/**
 * A problem as it is, and without the numbers of single vesicles and values.
 *
 * @param {string} problem
 */
function readings(problem) {
  return [problem, problem.replaceAll(/\.\d+(?=[.:])/g, "")];
}

/**
 * The reason in a problem without the path and the value, which the form shows beside it.
 *
 * @param {string} problem
 * @param {string} path
 */
function reasonIn(problem, path) {
  const reason = isOf(problem, path) ? problem.slice(problem.indexOf(": ") + 2).split(" — ").pop() : problem;
  return /** @type {string} */ (reason).replaceAll("input should be", "must be");
}
