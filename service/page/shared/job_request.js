// A request that makes a job: sent again after its answer was lost, it makes no second one.

import { isAbort, Problem, send } from "./api.js";
import { sentence } from "./figures.js";

export class OneJob {
  #key = newKey();

  /**
   * Resolves to the job that `request(headers)` is answered. The key stays until it has made a job: a
   * request that was refused has made none, and of a request without an answer nobody knows.
   * @param {(headers: Record<string, string>) => Promise<Api.JobView>} request
   * @returns {Promise<Api.JobView>}
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
 * What a form does that makes a job of another: sends the request, and resolves to what leads to the new job.
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
