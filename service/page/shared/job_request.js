// Requests that make one job, even if they are repeated after a lost answer.

import { isAbort, Problem, send } from "./api.js";
import { sentence } from "./figures.js";

export class OneJob {
  #key = newKey();

  /**
   * Resolves to the job, or the batch, that `request(headers)` makes. The key stays the same until it has made a job: a
   * refused request has made none, and one without an answer may have.
   * @template Made
   * @param {(headers: Record<string, string>) => Promise<Made>} request
   * @returns {Promise<Made>}
   */
  async make(request) {
    try {
      return await request({ "Idempotency-Key": this.#key });
    } catch (error) {
      if (isAbort(error)) throw error;
      if (!(error instanceof Problem) || error.status >= 500) throw new Error(notKnown(error), { cause: error });
      if (error.slug === "idempotency-key-reused") {
        this.#key = newKey();
        error.message = `Your earlier request has arrived, as job ${error.details.job_id}. Ask again to have this one too.`;
      }
      throw error;
    }
  }
}

/**
 * The `send` of a form that makes a job from another one; it resolves to the way to the new job.
 * @param {string} path
 * @param {() => object} changes
 * @param {(path: string) => void} go
 */
export function jobMaker(path, changes, go) {
  const wanted = new OneJob();
  return async () => {
    const next = await wanted.make((headers) => send("POST", path, changes(), headers));
    return () => go(`/jobs/${next.id}`);
  };
}

/** @param {unknown} error */
function notKnown(error) {
  const said = error instanceof Problem ? sentence(error.message) : "The service did not answer.";
  return `${said} It is not known whether the request arrived; try again: nothing is made twice.`;
}

function newKey() {
  return [...crypto.getRandomValues(new Uint8Array(16))].map((byte) => byte.toString(16).padStart(2, "0")).join("");
}
