/** The WebSocket to the service: hello, silence noticed, reconnected by itself. */

const PING_MS = 500;
/** Pongs come twice a second: longer without a word, something is wrong. */
const QUIET_MS = 1_300;
/** Given up only later: with the connection ends what this page has armed. */
const SILENCE_MS = 3_000;
const WELCOME_MS = 3_000;
const FIRST_PAUSE_MS = 200;
const LONGEST_PAUSE_MS = 1_000;

/**
 * Events: `state` (detail: {state, reason, code}; `connecting`, `open`, `closed` or
 * `denied`, then with the code of the refusal),
 * `message` (detail: a JSON message of the service), `frame` (detail: ArrayBuffer).
 * After `denied` it waits for `retry`; after `closed` it tries again by itself.
 */
export class Link extends EventTarget {
  #token;
  #page;
  #socket = null;
  #watching = null;
  #timer = null;
  #deadline = null;
  #heardMs = 0;
  #pauseMs = FIRST_PAUSE_MS;
  #pings = 0;
  #ended = false;

  /**
   * @param {() => (string|null)} token the token to present, or null
   * @param {() => (string|null)} page `participant`, or null: any other page
   */
  constructor(token, page = () => null) {
    super();
    this.#token = token;
    this.#page = page;
    this.state = "connecting";
    this.reason = "";
    this.welcome = null;
    window.addEventListener("online", this.#onOnline);
  }

  #onOnline = () => this.state === "closed" && this.retry();

  /** Whether an open connection has said nothing for too long. */
  get quiet() {
    return this.state === "open" && performance.now() - this.#heardMs > QUIET_MS;
  }

  /** Connect now, also after `denied`. */
  retry() {
    if (this.#ended) return;
    this.#drop();
    this.#become("connecting", this.reason);
    const url = new URL("/v1/live", location.href);
    url.protocol = url.protocol === "https:" ? "wss:" : "ws:";
    const socket = new WebSocket(url);
    socket.binaryType = "arraybuffer";
    const hello = { op: "hello", version: 1, token: this.#token(), page: this.#page() };
    socket.onopen = () => this.#send(hello);
    socket.onmessage = (event) => this.#hear(event.data);
    socket.onclose = (event) => this.#lose(event.reason || "the service does not answer");
    this.#socket = socket;
    this.#deadline = setTimeout(() => this.#lose("the service does not answer"), WELCOME_MS);
  }

  /** Ask for a rig's data; asked again by itself after every reconnection. */
  watch(request) {
    this.#watching = { op: "watch", ...request };
    if (this.state === "open") this.#send(this.#watching);
  }

  /** Send a message; whether it could be sent. */
  send(message) {
    if (this.state !== "open") return false;
    this.#send(message);
    return true;
  }

  /** Close for good. */
  end() {
    this.#ended = true;
    window.removeEventListener("online", this.#onOnline);
    this.#drop();
  }

  #send(message) {
    this.#socket.send(JSON.stringify(message));
  }

  #hear(data) {
    this.#heardMs = performance.now();
    if (typeof data !== "string") {
      this.dispatchEvent(new CustomEvent("frame", { detail: data }));
      return;
    }
    const message = JSON.parse(data);
    if (message.op === "welcome") this.#open(message);
    if (message.op === "refused" && this.state === "connecting") {
      this.#drop();
      this.#become("denied", message.message, message.code);
      return;
    }
    this.dispatchEvent(new CustomEvent("message", { detail: message }));
  }

  #open(welcome) {
    clearTimeout(this.#deadline);
    this.welcome = welcome;
    this.#pauseMs = FIRST_PAUSE_MS;
    this.#timer = setInterval(() => this.#ping(), PING_MS);
    this.#become("open", "");
    if (this.#watching) this.#send(this.#watching);
  }

  #ping() {
    if (performance.now() - this.#heardMs > SILENCE_MS) {
      this.#lose("the service has fallen silent");
    } else {
      this.#send({ op: "ping", id: this.#pings++ });
    }
  }

  #lose(reason) {
    this.#drop();
    this.#become("closed", reason);
    this.#timer = setTimeout(() => this.retry(), this.#pauseMs);
    this.#pauseMs = Math.min(2 * this.#pauseMs, LONGEST_PAUSE_MS);
  }

  #drop() {
    clearTimeout(this.#timer); // of an interval, too
    clearTimeout(this.#deadline);
    if (this.#socket === null) return;
    this.#socket.onopen = this.#socket.onmessage = this.#socket.onclose = null;
    this.#socket.close(); // may take long where the network is gone: nobody waits for it
    this.#socket = null;
  }

  #become(state, reason, code = "") {
    this.state = state;
    this.reason = reason;
    this.dispatchEvent(new CustomEvent("state", { detail: { state, reason, code } }));
  }
}
