/**
 * Requests to the service. Addresses are paths from its root, for example `/jobs`. A proxy may serve it below a prefix
 * of its own, so they are resolved against the address of the page. Errors are thrown as `Problem`.
 */

import { Problem } from "./problems.js";
import { askForToken, token } from "./token.js";
import { readEvents } from "./events.js";

const UNAUTHORIZED = 401;
const SECONDS_TO_RECONNECT = 1;

/**
 * @param {string} path
 * @param {RequestInit} [options]
 * @returns {Promise<Response>} A response with a status of success.
 */
async function request(path, options = {}) {
  const sentToken = token();
  const headers = new Headers(options.headers);
  if (sentToken) {
    headers.set("Authorization", `Bearer ${sentToken}`);
  }
  const response = await fetch(new URL(path.replace(/^\//, ""), document.baseURI), { ...options, headers });
  if (response.ok) {
    return response;
  }
  const problem = await Problem.of(response);
  if (problem.status !== UNAUTHORIZED) {
    throw problem;
  }
  // Another request may have asked for a new token in the meantime.
  if (token() === sentToken) {
    await askForToken(
      sentToken ? "The service does not accept this token." : "This service requires a token.",
    );
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
 * Get an array of little-endian float32.
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
 * Get a file.
 *
 * @param {string} path
 * @returns {Promise<Blob>}
 */
export async function getBlob(path) {
  return (await request(path)).blob();
}

/**
 * Send a document and get the document of the answer.
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
 * Get all items of a collection, page by page.
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
 * Yield a document in its present state and after each change. Continue while the service restarts.
 *
 * The browser caches the document with its ETag, so requests for an unchanged document cost little.
 *
 * @param {string} path
 * @param {number} seconds - Between two requests.
 * @param {AbortSignal} signal
 * @returns {AsyncGenerator<any>}
 */
export async function* changesOf(path, seconds, signal) {
  let shown = null;
  while (!signal.aborted) {
    const text = await getText(path, signal).catch(ignoreUnreachable(signal));
    if (text !== undefined && text !== shown) {
      shown = text;
      yield JSON.parse(text);
    }
    await pause(seconds, signal);
  }
}

/**
 * Yield the documents of server-sent events. Reconnect when the connection is interrupted.
 *
 * `EventSource` is not used because it cannot send a token.
 *
 * @param {string} path
 * @param {(document: any) => boolean} isLast - Whether a document is the last one.
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
      ignoreUnreachable(signal)(error);
    }
    await pause(SECONDS_TO_RECONNECT, signal);
  }
}

/**
 * Return a handler that ignores the error of `fetch` for a service that cannot be reached.
 *
 * @param {AbortSignal} signal
 * @returns {(error: unknown) => undefined}
 */
function ignoreUnreachable(signal) {
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
