/** The imposed flow.  All kinds are linear, so relative to any point that moves along they look the same. */

/**
 * The velocity gradient of a scene's flow as rows; null in quiescent fluid.
 *
 * @param {any} scene
 * @returns {[[number, number], [number, number]] | null}
 */
export function velocityGradient({ flow }) {
  if (!flow || flow.rate === 0) {
    return null;
  }
  return flow.kind === "shear"
    ? [
        [0, flow.rate],
        [0, 0],
      ]
    : [
        [-flow.rate, 0],
        [0, flow.rate],
      ];
}
