// The page's calls of the API. After a 401 the page asks for a key and repeats the call.

import { askForKey, authorization } from "./api_key.js";
import { h } from "./dom.js";
import { complain, say } from "./notices.js";
import { sleep, whileHidden } from "./polling.js";

/** @typedef {{ type?: string, title?: string, detail?: string, code?: string, job_id?: string,
 *   errors?: { field: string, message: string }[] }} Details */

/** An error that the API explained (RFC 9457). */
export class Problem extends Error {
  /**
   * @param {number} status
   * @param {Details} details
   */
  constructor(status, details) {
    super(details.detail || details.title || `the service answered ${status}`);
    this.status = status;
    this.slug = String(details.type ?? "").split("/").pop() ?? "";
    this.details = details;
  }
}

/**
 * Whether the API refused with one of these problems, named by the last part of the type.
 * @param {unknown} error
 * @param {string[]} slugs
 */
export function isProblem(error, ...slugs) {
  return error instanceof Problem && slugs.includes(error.slug);
}

/**
 * Whether a request was aborted because nobody wants its answer any more.
 * @param {unknown} error
 */
export function isAbort(error) {
  return error instanceof DOMException && error.name === "AbortError";
}

/** The message after a change without an answer. */
const NO_ANSWER = "The service did not answer, so it is not known whether this arrived. Try again.";

/**
 * Calls with the known key, and again with another if that is refused.
 * @param {(key: Record<string, string>) => Promise<Response>} call
 */
async function withKey(call) {
  for (;;) {
    const used = authorization();
    const answer = await call(used);
    if (answer.status === 401 && (await askForKey(used))) continue;
    if (!answer.ok) throw new Problem(answer.status, await answer.json().catch(() => ({})));
    return answer;
  }
}

/**
 * @param {string} path
 * @param {RequestInit & { headers?: Record<string, string> }} options
 */
function fetched(path, options = {}) {
  return withKey(async (key) => {
    try {
      return await fetch(path, { ...options, headers: { ...options.headers, ...key } });
    } catch (error) {
      if (options.signal?.aborted) throw error;
      throw new Error(options.method ? NO_ANSWER : "The service cannot be reached.");
    }
  });
}

/**
 * GETs JSON.
 * @param {string} path
 * @param {AbortSignal} [signal]
 */
export async function get(path, signal) {
  return (await fetched(path, { signal, headers: { Accept: "application/json" } })).json();
}

/**
 * Sends a change; resolves to the answer.
 * @param {string} method
 * @param {string} path
 * @param {unknown} [body]
 * @param {Record<string, string>} headers
 */
export async function send(method, path, body, headers = {}) {
  const json = body !== undefined && { "Content-Type": "application/json" };
  const answer = await fetched(path, { method, body: JSON.stringify(body), headers: { ...json, ...headers } });
  return answer.status === 204 ? null : answer.json();
}

/**
 * GETs bytes, with their ETag, and the spp of an image.
 * @param {string} path
 * @param {AbortSignal} [signal]
 */
export async function bytes(path, signal) {
  const answer = await fetched(path, { signal });
  const spp = answer.headers.get("Plateau-Spp");
  return { blob: await answer.blob(), tag: answer.headers.get("ETag"), spp: spp ? Number(spp) : null };
}

/**
 * A link that saves a file; a plain link would not send the key.
 * @param {string} path
 * @param {string} name - of the saved file
 * @param {string} text
 */
export function downloadLink(path, name, text) {
  const link = h("a", { href: path, download: name, onclick: save }, text);
  return link;

  /** @param {MouseEvent} event */
  async function save(event) {
    event.preventDefault();
    if (link.ariaBusy) return;
    link.ariaBusy = "true";
    say(`Fetching ${name} …`);
    try {
      const { blob } = await bytes(link.href);
      const saved = h("a", { href: URL.createObjectURL(blob), download: name });
      saved.click();
      setTimeout(() => URL.revokeObjectURL(saved.href), 10_000);
    } catch (error) {
      complain(error, true);
    } finally {
      link.ariaBusy = null;
    }
  }
}

/**
 * Sends a form and reports its progress, which `fetch` cannot do.
 * @param {string} path
 * @param {FormData} form
 * @param {{ signal: AbortSignal, onProgress?: (sent: number, all: number) => void, headers?: Record<string, string> }} options
 */
export async function upload(path, form, { onProgress, signal, headers = {} }) {
  const answer = await withKey((key) => new Promise((resolve, reject) => {
    signal.throwIfAborted();
    const request = new XMLHttpRequest();
    request.open("POST", path);
    for (const [name, value] of Object.entries({ ...headers, ...key })) request.setRequestHeader(name, value);
    request.upload.onprogress = ({ loaded, total }) => onProgress?.(loaded, total);
    request.onload = () => resolve(new Response(request.response, { status: request.status }));
    request.onerror = () => reject(new Error(NO_ANSWER));
    request.onabort = () => reject(new DOMException("stopped", "AbortError"));
    signal.addEventListener("abort", () => request.abort(), { once: true });
    request.send(form);
  }));
  return answer.json();
}

const RETRY_MS = 1000;

/** @typedef {{ id: string, type: string, data: any }} JobEvent */

/**
 * Reads a job's events from the first to the last, through outages. EventSource cannot send a key.
 * @param {string} path
 * @param {(events: JobEvent[]) => void} onEvents
 * @param {AbortSignal} signal
 */
export async function follow(path, onEvents, signal) {
  let last = "";
  while (!signal.aborted) {
    const unseen = new AbortController();
    try {
      // A browser has six connections for all of its tabs: a hidden one gives back its own.
      while (document.hidden) await whileHidden(60_000, signal);
      document.onvisibilitychange = () => unseen.abort();
      const headers = { Accept: "text/event-stream", ...(last && { "Last-Event-ID": last }) };
      const answer = await fetched(path, { headers, signal: AbortSignal.any([signal, unseen.signal]) });
      if (answer.status === 204 || !answer.body) return;
      const reader = answer.body.pipeThrough(new TextDecoderStream()).getReader();
      let rest = "";
      for (;;) {
        const { value, done } = await reader.read();
        if (done) break;
        const frames = (rest + value).split("\n\n");
        rest = frames.pop() ?? "";
        const events = frames.map(parsed).filter((event) => event.type);
        if (!events.length) continue;
        last = events[events.length - 1].id;
        onEvents(events);
        if (events.some((event) => event.type === "finished")) return;
      }
    } catch (error) {
      if (signal.aborted) return;
      if (error instanceof Problem && error.status < 500 && error.status !== 401) throw error;
    }
    await sleep(RETRY_MS, signal).catch(() => {});
  }
}

/** @param {string} frame */
function parsed(frame) {
  /** @type {JobEvent} */
  const event = { id: "", type: "", data: null };
  for (const line of frame.split("\n")) {
    const [name, ...rest] = line.split(": ");
    const value = rest.join(": ");
    if (name === "id") event.id = value;
    else if (name === "event") event.type = value;
    else if (name === "data") event.data = JSON.parse(value);
  }
  return event;
}
