/** The friction that a scene asks for along a path of the finger. Pure. */

/** More would take longer to add up than the page has time. */
const MOST_COMPONENTS = 600;

/**
 * Why the target of a scene cannot be told, or "" where it can.
 *
 * @param {{source: string, scene: {regions: object[]}}} state a SceneState
 */
export function untold(state) {
  if (state.source === "stream") {
    return "A client streams the texture: what it asks for is not in the scene.";
  }
  if (state.source !== "scene") return "An excitation is played: there is no target friction.";
  const { regions } = state.scene;
  if (regions.length === 0) return "The scene is a smooth screen: there is no target.";
  const other = regions.find(({ texture }) => texture.kind !== "spectrum");
  if (other) return `The target of a ${other.texture.kind} texture is made on the rig only.`;
  const count = regions.reduce((sum, { texture }) => sum + texture.components.length, 0);
  if (count > MOST_COMPONENTS) {
    return `The texture has ${count} components; the page adds up at most ${MOST_COMPONENTS}.`;
  }
  return "";
}

/**
 * The regions that a whole path lies in, clear of edges; null where it crosses one.
 *
 * @param {object[]} regions
 * @param {{x: ArrayLike<number>, y: ArrayLike<number>}} path mm
 */
export function under(regions, path) {
  const over = [];
  for (const region of regions) {
    const along = [side(path.x, region.x_mm, region.edge_fade_mm)];
    along.push(side(path.y, region.y_mm, region.edge_fade_mm));
    if (along.includes("outside")) continue;
    if (along.includes("across")) return null;
    over.push(region);
  }
  return over;
}

function side(values, [from, to], fade) {
  let least = Infinity;
  let most = -Infinity;
  for (const value of values) {
    least = Math.min(least, value);
    most = Math.max(most, value);
  }
  if (most < from || least > to) return "outside";
  // The fade's default reaches past any screen: there it is not met.
  return least >= from + fade && most <= to - fade ? "inside" : "across";
}

/**
 * Friction asked for along a path, N.
 *
 * @param {object[]} regions all of kind spectrum
 * @param {{x: Float64Array, y: Float64Array}} path mm
 * @param {number} firstSample device index of the first point of the path
 * @param {number} stepS seconds between points
 * @param {number} sampleRateHz of the device
 * @param {number} gain as the rig applied it
 * @returns {Float64Array}
 */
export function friction(regions, path, firstSample, stepS, sampleRateHz, gain) {
  const made = new Float64Array(path.x.length);
  for (const { texture, gain: own } of regions) {
    const angle = (texture.angle_deg * Math.PI) / 180;
    const [cos, sin] = [Math.cos(angle), Math.sin(angle)];
    const along = path.x.map((x, i) => cos * x + sin * path.y[i]);
    const times = along.map((_, i) => firstSample / sampleRateHz + i * stepS);
    for (const component of texture.components) {
      const spatial = component.cycles_per_mm != null;
      const turns = 2 * Math.PI * (spatial ? component.cycles_per_mm : component.hz);
      const over = spatial ? along : times;
      const amplitude = gain * own * component.amplitude_n;
      for (let i = 0; i < made.length; i++) {
        made[i] += amplitude * Math.cos(turns * over[i] + component.phase_rad);
      }
    }
  }
  return made;
}
