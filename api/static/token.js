/** The bearer token of this tab, and the dialog that asks for it. */

const KEY = "token";

/** @type {Promise<void> | null} */
let asking = null;

/** @returns {string | null} */
export function token() {
  return window.sessionStorage.getItem(KEY);
}

/**
 * Ask for a token. Requests that are refused in the meantime wait for the same dialog.
 *
 * @param {string} reason
 * @returns {Promise<void>}
 */
export function askForToken(reason) {
  asking ??= ask(reason).finally(() => {
    asking = null;
  });
  return asking;
}

/**
 * @param {string} reason
 * @returns {Promise<void>}
 */
function ask(reason) {
  const dialog = /** @type {HTMLDialogElement} */ (document.getElementById("token-dialog"));
  const input = /** @type {HTMLInputElement} */ (document.getElementById("token"));
  /** @type {HTMLElement} */ (document.getElementById("token-reason")).textContent = reason;
  input.value = "";
  dialog.returnValue = ""; // remove the value of an earlier dialog
  dialog.showModal();
  return new Promise((resolve, reject) => {
    dialog.addEventListener(
      "close",
      () => {
        if (dialog.returnValue !== "enter") {
          reject(new Error(reason));
          return;
        }
        window.sessionStorage.setItem(KEY, input.value.trim());
        resolve();
      },
      { once: true },
    );
  });
}
