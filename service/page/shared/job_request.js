// A request that makes a job: sent again after its answer was lost, it makes no second one.

import { isAbort, Problem } from "./api.js";
import { sentence } from "./figures.js";

export class OneJob {
  #key = newKey();

  /**
   * Resolves to the job that `send(headers)` is answered. The key stays until it has made a job: a
   * request that was refused has made none, and of a request without an answer nobody knows.
   * @param {(headers: Record<string, string>) => Promise<Api.JobView>} send
   * @returns {Promise<Api.JobView>}
   */
  async make(send) {
    try {
      return await send({ "Idempotency-Key": this.#key });
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
