/** Numbers, times and names as text. */

/** @typedef {number | string | null | undefined} Maybe - Numbers that are not finite come as text. */

/**
 * Write a number with at most this many significant digits.
 *
 * @param {Maybe} value
 * @param {number} [digits]
 * @returns {string}
 */
export function number(value, digits = 4) {
  if (typeof value !== "number") {
    return value ?? "–";
  }
  const magnitude = Math.abs(value);
  const isPlain = value === 0 || (magnitude >= 1e-3 && magnitude < 1e6);
  return isPlain
    ? withMinus(String(Number(value.toPrecision(digits))))
    : powerOfTen(value, Math.min(digits, 3));
}

/**
 * @param {number} value
 * @param {number} digits
 * @returns {string}
 */
function powerOfTen(value, digits) {
  const [mantissa, exponent] = value.toExponential(digits - 1).split("e");
  const raised = [...String(Number(exponent))].map((digit) => "⁰¹²³⁴⁵⁶⁷⁸⁹"[Number(digit)] ?? "⁻").join("");
  const factor = Number(mantissa);
  return factor === 1 ? `10${raised}` : `${withMinus(String(factor))}\u00d710${raised}`;
}

/** @param {string} text */
function withMinus(text) {
  return text.replace("-", "\u2212");
}

/**
 * Write a bracket with enough digits to distinguish its ends.
 *
 * @param {[number | null, number | null]} bracket
 * @returns {string}
 */
export function interval([low, high]) {
  if (low === null && high === null) {
    return "not bracketed";
  }
  if (low === null || high === null) {
    return low === null ? `below ${number(high)}` : `above ${number(low)}`;
  }
  return ends([low, high]).join(" – ");
}

/**
 * Write the ends of a bracket, each with enough digits to distinguish them.
 *
 * @param {[number, number]} bracket
 * @returns {string[]}
 */
export function ends([low, high]) {
  const decimals = Math.min(Math.max(1 - Math.floor(Math.log10(high - low || high)), 0), 10);
  return [low, high].map((end) => end.toFixed(decimals));
}

/**
 * Write a duration.
 *
 * @param {number} seconds
 * @returns {string}
 */
export function duration(seconds) {
  if (seconds < 60) {
    return `${number(seconds, seconds < 10 ? 2 : 3)} s`;
  }
  const minutes = Math.floor(seconds / 60);
  return minutes < 60
    ? `${minutes} min ${Math.round(seconds % 60)} s`
    : `${Math.floor(minutes / 60)} h ${minutes % 60} min`;
}

/**
 * Write how long something takes that is known roughly.
 *
 * @param {number} seconds
 * @returns {string}
 */
export function roughly(seconds) {
  if (seconds < 10) {
    return "a few seconds";
  }
  /** @type {[string, number][]} */
  const units = [
    ["s", 1],
    ["min", 60],
    ["h", 3600],
    ["days", 86400],
  ];
  const [name, length] = units.filter(([, each]) => seconds >= 1.5 * each).pop() ?? units[0];
  return `about ${number(seconds / length, seconds / length < 100 ? 2 : 3)} ${name}`;
}

const moments = new Intl.DateTimeFormat(undefined, { dateStyle: "medium", timeStyle: "short" });

/**
 * @param {string} moment - ISO 8601.
 * @returns {string}
 */
export function dateAndTime(moment) {
  return moments.format(new Date(moment));
}

/**
 * Write the name of a preset or a study as words.
 *
 * @param {string} name
 * @returns {string}
 */
export function words(name) {
  const spaced = name.replaceAll(/[-_]/g, " ");
  return spaced.charAt(0).toUpperCase() + spaced.slice(1);
}
