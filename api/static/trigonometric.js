/**
 * Trigonometric interpolation: values between equally spaced ones of a periodic function, from its Fourier coefficients.
 *
 * That is how the solver represents membranes, so a curve through the interpolated points is the computed one.
 */

/** @type {Map<string, Float64Array[]>} */
const kernels = new Map();

/**
 * Return so many times as many values.
 *
 * @param {Float32Array} values - At equally spaced points; their number is even.
 * @param {number} factor - A positive integer.
 * @returns {Float32Array} Every so many of them is one of the given values.
 */
export function refined(values, factor) {
  if (factor === 1) {
    return values;
  }
  const count = values.length;
  const result = new Float32Array(count * factor);
  kernelsOf(count, factor).forEach((kernel, part) => {
    for (let point = 0; point < count; point += 1) {
      let sum = 0;
      for (let other = 0; other < count; other += 1) {
        sum += kernel[(point - other + count) % count] * values[other];
      }
      result[point * factor + part] = sum;
    }
  });
  return result;
}

/**
 * For each fraction of the spacing, the weights of the values by their distance in points.
 *
 * @param {number} count
 * @param {number} factor
 */
function kernelsOf(count, factor) {
  const name = `${count} ${factor}`;
  const known = kernels.get(name);
  if (known) {
    return known;
  }
  const made = Array.from({ length: factor }, (_, part) =>
    Float64Array.from({ length: count }, (__, distance) => weight(distance + part / factor, count)),
  );
  kernels.set(name, made);
  return made;
}

/**
 * The periodic sinc function of an even number of points, whose highest mode is a cosine.
 *
 * @param {number} distance - In points.
 * @param {number} count
 */
function weight(distance, count) {
  const half = (Math.PI * distance) / count;
  return distance % count === 0 ? 1 : Math.sin(count * half) / (count * Math.tan(half));
}
