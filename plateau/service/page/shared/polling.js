// Waiting and polling.

import { complain, recovered } from "./notices.js";

/**
 * Resolves after `ms` milliseconds; rejects when the signal aborts.
 * @param {number} ms
 * @param {AbortSignal} signal
 * @returns {Promise<void>}
 */
export function sleep(ms, signal) {
  return new Promise((resolve, reject) => {
    if (signal.aborted) { reject(signal.reason); return; }
    const stop = () => { clearTimeout(timer); reject(signal.reason); };
    const timer = setTimeout(() => { signal.removeEventListener("abort", stop); resolve(); }, ms);
    signal.addEventListener("abort", stop);
  });
}

/**
 * Resolves once the page is seen, at the latest after `ms` milliseconds; rejects when the signal aborts.
 * @param {number} ms
 * @param {AbortSignal} signal
 */
export async function whileHidden(ms, signal) {
  if (!document.hidden) return;
  const seen = new AbortController();
  const note = () => seen.abort();
  document.addEventListener("visibilitychange", note);
  try {
    await sleep(ms, AbortSignal.any([signal, seen.signal]));
  } catch {
    signal.throwIfAborted();
  } finally {
    document.removeEventListener("visibilitychange", note);
  }
}

/**
 * Calls `work` again and again, `everyMs()` apart, and half a minute while the page is hidden.
 * @param {() => Promise<unknown>} work
 * @param {() => number} everyMs
 * @param {AbortSignal} signal
 */
export async function repeat(work, everyMs, signal) {
  while (!signal.aborted) {
    try {
      await work();
      recovered();
    } catch (error) {
      if (signal.aborted) return;
      complain(error);
    }
    try {
      await sleep(everyMs(), signal);
      await whileHidden(30_000, signal);
    } catch {
      return;
    }
  }
}
