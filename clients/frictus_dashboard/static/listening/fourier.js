/** The discrete Fourier transform of real samples. Pure. */

/**
 * Squared magnitudes of the transform.
 *
 * @param {Float64Array} samples a power of two of them
 * @returns {Float64Array} for the frequencies 0 to half the sample rate, length n / 2 + 1
 */
export function power(samples) {
  const n = samples.length;
  const re = Float64Array.from(samples);
  const im = new Float64Array(n);
  for (let i = 1, j = 0; i < n; i++) {
    let bit = n >> 1;
    for (; j & bit; bit >>= 1) j ^= bit;
    j ^= bit;
    if (i < j) [re[i], re[j]] = [re[j], re[i]];
  }
  for (let size = 2; size <= n; size *= 2) butterflies(re, im, size);
  return Float64Array.from({ length: n / 2 + 1 }, (_, i) => re[i] ** 2 + im[i] ** 2);
}

function butterflies(re, im, size) {
  const half = size / 2;
  for (let k = 0; k < half; k++) {
    const cos = Math.cos((-2 * Math.PI * k) / size);
    const sin = Math.sin((-2 * Math.PI * k) / size);
    for (let a = k; a < re.length; a += size) {
      const b = a + half;
      const real = re[b] * cos - im[b] * sin;
      const imaginary = re[b] * sin + im[b] * cos;
      re[b] = re[a] - real;
      im[b] = im[a] - imaginary;
      re[a] += real;
      im[a] += imaginary;
    }
  }
}
