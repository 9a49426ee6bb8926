// @ts-check
// The smallest window in which a round fits, and the switch between the two board sizes (participant.css).

export const SMALLEST = { width: 1024, height: 640 };

/** @param {{ innerWidth: number, innerHeight: number }} page */
export function isTooSmall({ innerWidth, innerHeight }) {
  return innerWidth < SMALLEST.width || innerHeight < SMALLEST.height;
}

/**
 * Calls back now and whenever the window becomes too small or large enough.
 * @param {Window} page
 * @param {(small: boolean) => void} tell
 */
export function watchViewport(page, tell) {
  /** @type {boolean | null} */ let last = null;
  const look = () => {
    const small = isTooSmall(page);
    if (small !== last) tell(small);
    last = small;
  };
  page.addEventListener("resize", look);
  look();
}
