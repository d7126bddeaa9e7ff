// Requests that make one job, even if they are repeated after a lost answer.

import { isAbort, Problem } from "./api.js";
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

/** @param {unknown} error */
function notKnown(error) {
  const said = error instanceof Problem ? sentence(error.message) : "The service did not answer.";
  return `${said} It is not known whether the request arrived; try again: nothing is made twice.`;
}

function newKey() {
  return [...crypto.getRandomValues(new Uint8Array(16))].map((byte) => byte.toString(16).padStart(2, "0")).join("");
}
