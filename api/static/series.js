/** The diagnostics of a run over time. */

import { get } from "./api.js";

const NUMBERS_AT_ONCE = 500_000; // in one answer; half of the default limit of the service

/**
 * Get the diagnostics of a run by name; of a long run every second, third, … record.
 *
 * @param {string} address - Of the run.
 * @param {AbortSignal} signal
 * @param {number} [numbersAtOnce]
 * @returns {Promise<Record<string, (number | null)[]>>}
 */
export async function seriesOf(address, signal, numbersAtOnce = NUMBERS_AT_ONCE) {
  const { series, total } = await get(`${address}/series?stop=1`, signal);
  const stride = Math.max(Math.ceil((total * Object.keys(series).length) / numbersAtOnce), 1);
  return (await get(`${address}/series?stride=${stride}`, signal)).series;
}
