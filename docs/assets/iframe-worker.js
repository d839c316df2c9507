// SPDX-License-Identifier: Apache-2.0
// Search runs in a Worker, which browsers refuse to pages that are opened from the disk. There a hidden frame runs the same script.
if (location.protocol === "file:") {
  window.Worker = class extends EventTarget {
    constructor(url) {
      super();
      const frame = document.createElement("iframe");
      frame.hidden = true;
      document.body.appendChild(frame);
      const inside = frame.contentWindow;
      const deliver = (target, data) => {
        const event = new MessageEvent("message", { data });
        target.dispatchEvent(event);
        if (target.onmessage) target.onmessage(event);
      };
      inside.postMessage = (data) => setTimeout(() => deliver(this, data));
      inside.importScripts = (...urls) =>
        urls.reduce((done, next) => done.then(() => new Promise((resolve, reject) => {
          const script = inside.document.createElement("script");
          script.src = next;
          script.onload = resolve;
          script.onerror = reject;
          inside.document.head.appendChild(script);
        })), Promise.resolve());
      this.ready = inside.importScripts(url);
      this.postMessage = (data) => this.ready.then(() => deliver(inside, data));
      this.terminate = () => frame.remove();
    }
  };
}
