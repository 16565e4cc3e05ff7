/**
 * Permanent links: the part of the address after `#`, a path and a query, selects the view.
 *
 * A view gets a signal that is aborted when another view replaces it. Everything that the view started (requests,
 * timers, listeners, plots) ends with this signal.
 */

import { element } from "./dom.js";
import { alertAbout } from "./problems.js";

/**
 * @typedef {object} Place
 * @property {HTMLElement} content - The element that the view fills.
 * @property {Record<string, string>} parameters - Named groups of the route's path.
 * @property {URLSearchParams} query
 * @property {AbortSignal} signal - Aborted when another view is shown.
 *
 * @typedef {object} Route
 * @property {RegExp} path
 * @property {string} section - The link of the navigation that is marked as current.
 * @property {(place: Place) => Promise<void>} show
 */

/** Path and query of the address. */
function location() {
  const [path, query = ""] = (window.location.hash.slice(1) || "/").split("?", 2);
  return { path, query: new URLSearchParams(query) };
}

/**
 * Show the view that the address names, now and whenever the address changes.
 *
 * @param {Route[]} routes
 */
export function startRouter(routes) {
  const content = /** @type {HTMLElement} */ (document.getElementById("content"));
  let leaving = new AbortController();

  async function show() {
    leaving.abort();
    leaving = new AbortController();
    const { signal } = leaving;
    const { path, query } = location();
    const route = routes.find((candidate) => candidate.path.test(path));
    markCurrent(route?.section);
    document.title = "Vesicle ensemble";
    content.replaceChildren();
    if (!route) {
      document.title = "Page not found – Vesicle ensemble";
      content.replaceChildren(
        element("h1", {}, "Page not found"),
        element("p", {}, "There is nothing at ", element("code", {}, path), "."),
        wayBack("boundaries"),
      );
      return;
    }
    try {
      await route.show({ content, query, signal, parameters: { ...route.path.exec(path)?.groups } });
    } catch (error) {
      if (!signal.aborted) {
        const title = content.querySelector("h1") ? "" : element("h1", {}, "This cannot be shown");
        content.append(title, alertAbout(error), wayBack(route.section));
      }
    }
  }

  window.addEventListener("hashchange", async () => {
    await show();
    content.focus({ preventScroll: true });
    window.scrollTo(0, 0);
  });
  document.querySelector("[data-skip]")?.addEventListener("click", (event) => {
    event.preventDefault(); // its hash is not a path of a view
    content.focus();
  });
  void show();
}

/** @param {string} section - To which a link leads. */
function wayBack(section) {
  const name = document.querySelector(`nav a[href="#/${section}"]`)?.textContent ?? section;
  return element("p", {}, element("a", { class: "button", href: `#/${section}` }, `Back to ${name.toLowerCase()}`));
}

/** @param {string | undefined} section */
function markCurrent(section) {
  for (const link of document.querySelectorAll("nav a")) {
    if (link.getAttribute("href") === `#/${section}`) {
      link.setAttribute("aria-current", "page");
    } else {
      link.removeAttribute("aria-current");
    }
  }
}

/**
 * Put a value into the query of the address without changing the view.
 *
 * @param {string} name
 * @param {string} value
 */
export function keepInAddress(name, value) {
  const { path, query } = location();
  query.set(name, value);
  window.history.replaceState(null, "", `#${path}?${query}`);
}

/** @param {string} path - With its query. */
export function goTo(path) {
  window.location.hash = path;
}

/**
 * Make a link to a run, named by the beginning of its key as on the command line.
 *
 * @param {string} key
 */
export function runLink(key) {
  return element("a", { href: `#/runs/${key}` }, element("code", {}, key.slice(0, 8)));
}
