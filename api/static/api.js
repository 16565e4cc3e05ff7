/** Requests to the service.  Addresses are paths such as `/jobs`; errors are `Problem`. */

import { Problem } from "./problems.js";
import { askForToken, token } from "./token.js";
import { readEvents } from "./events.js";

const UNAUTHORIZED = 401;
const SECONDS_TO_RECONNECT = 1;

/**
 * @param {string} path
 * @param {RequestInit} [options]
 * @returns {Promise<Response>} One that is ok.
 */
async function request(path, options = {}) {
  const used = token();
  const headers = new Headers(options.headers);
  if (used) {
    headers.set("Authorization", `Bearer ${used}`);
  }
  const response = await fetch(path, { ...options, headers });
  if (response.ok) {
    return response;
  }
  const problem = await Problem.of(response);
  if (problem.status !== UNAUTHORIZED) {
    throw problem;
  }
  // Another request may have got a new token while this one was under way.
  if (token() === used) {
    await askForToken(used ? "The service does not accept this token." : "This service asks for a token.");
  }
  return request(path, options);
}

/**
 * Get a document.
 *
 * @param {string} path
 * @param {AbortSignal} signal
 * @returns {Promise<any>}
 */
export async function get(path, signal) {
  return (await request(path, { signal })).json();
}

/**
 * @param {string} path
 * @param {AbortSignal} signal
 * @returns {Promise<string>}
 */
export async function getText(path, signal) {
  return (await request(path, { signal })).text();
}

/**
 * Get numbers: little-endian float32.
 *
 * @param {string} path
 * @param {AbortSignal} signal
 * @returns {Promise<Float32Array>}
 */
export async function getNumbers(path, signal) {
  const headers = { Accept: "application/octet-stream" };
  return new Float32Array(await (await request(path, { signal, headers })).arrayBuffer());
}

/**
 * Send a document and get the answer's.
 *
 * @param {string} path
 * @param {unknown} document
 * @param {{signal?: AbortSignal, headers?: Record<string, string>}} [options]
 * @returns {Promise<any>}
 */
export async function post(path, document, { signal, headers } = {}) {
  const response = await request(path, {
    method: "POST",
    signal,
    headers: { ...headers, "Content-Type": "application/json" },
    body: JSON.stringify(document),
  });
  return response.json();
}

/**
 * @param {string} path
 * @returns {Promise<void>}
 */
export async function remove(path) {
  await request(path, { method: "DELETE" });
}

/**
 * All items of a collection.
 *
 * @param {string} path
 * @param {AbortSignal} signal
 * @returns {Promise<any[]>}
 */
export async function getAll(path, signal) {
  const items = [];
  for (let next = path; next;) {
    const page = await get(next, signal);
    items.push(...page.items);
    next = page.next;
  }
  return items;
}

/**
 * A document, now and each time that it has changed; also across times in which the service is away.
 *
 * The browser keeps the document with its ETag, so asking again for one that is the same costs next to nothing.
 *
 * @param {string} path
 * @param {number} seconds - Between two questions.
 * @param {AbortSignal} signal
 * @returns {AsyncGenerator<any>}
 */
export async function* changesOf(path, seconds, signal) {
  let seen = null;
  while (!signal.aborted) {
    const text = await getText(path, signal).catch(unlessAway(signal));
    if (text !== undefined && text !== seen) {
      seen = text;
      yield JSON.parse(text);
    }
    await pause(seconds, signal);
  }
}

/**
 * The documents that the service sends as server-sent events, also across interrupted connections.
 *
 * `EventSource` would not do: it cannot send a token.
 *
 * @param {string} path
 * @param {(document: any) => boolean} isLast - Whether nothing comes after a document.
 * @param {AbortSignal} signal
 * @returns {AsyncGenerator<any>}
 */
export async function* eventsOf(path, isLast, signal) {
  while (!signal.aborted) {
    try {
      const response = await request(path, { signal, headers: { Accept: "text/event-stream" } });
      for await (const data of readEvents(/** @type {ReadableStream<BufferSource>} */ (response.body))) {
        const document = JSON.parse(data);
        yield document;
        if (isLast(document)) {
          return;
        }
      }
    } catch (error) {
      unlessAway(signal)(error);
    }
    await pause(SECONDS_TO_RECONNECT, signal);
  }
}

/**
 * A handler that passes over the error by which `fetch` says that the service cannot be reached.
 *
 * @param {AbortSignal} signal
 * @returns {(error: unknown) => undefined}
 */
function unlessAway(signal) {
  return (error) => {
    if (signal.aborted || !(error instanceof TypeError)) {
      throw error;
    }
  };
}

/**
 * @param {number} seconds
 * @param {AbortSignal} signal - Ends the pause early.
 * @returns {Promise<void>}
 */
function pause(seconds, signal) {
  return new Promise((resolve) => {
    const timer = setTimeout(resolve, 1000 * seconds);
    signal.addEventListener(
      "abort",
      () => {
        clearTimeout(timer);
        resolve();
      },
      { once: true },
    );
  });
}
