/** Colors of tensions: Matplotlib's plasma without the end that is hardly visible on the page. */

const PLASMA = [
  [13, 8, 135],
  [49, 5, 151],
  [76, 2, 161],
  [102, 0, 167],
  [126, 3, 168],
  [149, 17, 161],
  [170, 35, 149],
  [188, 53, 135],
  [204, 71, 120],
  [218, 90, 106],
  [230, 108, 92],
  [240, 128, 79],
  [248, 149, 64],
  [253, 172, 51],
  [253, 197, 39],
  [248, 223, 37],
  [240, 249, 33],
];
const ON_LIGHT = [0, 0.86];
const ON_DARK = [0.22, 1];

/**
 * @param {number} share - From 0 to 1; values outside get the color of the nearer end.
 * @param {boolean} isDark
 * @returns {string}
 */
export function tensionColor(share, isDark) {
  const [first, last] = isDark ? ON_DARK : ON_LIGHT;
  const place = (first + (last - first) * Math.min(Math.max(share, 0), 1)) * (PLASMA.length - 1);
  const below = Math.min(Math.floor(place), PLASMA.length - 2);
  const mixed = PLASMA[below].map(
    (value, channel) => value + (place - below) * (PLASMA[below + 1][channel] - value),
  );
  return `rgb(${mixed.map(Math.round).join(" ")})`;
}

/**
 * Return the range of the color map: the tensions of all frames except the first, if there are several.
 *
 * The initial ellipses have tensions several times larger, which would leave one color for the rest of the run. The
 * range is never so narrow that rounding errors become visible.
 *
 * @param {import("./frames.js").State[]} states
 * @returns {[number, number]}
 */
export function tensionRange(states) {
  let [low, high] = [Infinity, -Infinity];
  for (const { membranes } of states.length > 1 ? states.slice(1) : states) {
    for (const { tension } of membranes) {
      for (const value of tension) {
        low = Math.min(low, value);
        high = Math.max(high, value);
      }
    }
  }
  const margin = Math.max(0, 1e-3 * (1 + Math.abs(low)) - (high - low)) / 2;
  return [low - margin, high + margin];
}
