/* Browsers refuse workers in pages opened as files. This stand-in runs the search's worker in a
   hidden frame, whose messages it passes on, so that searching needs no server. */
(function () {
  "use strict";
  if (location.protocol !== "file:") return;

  /* In the frame: what a worker has and a page has not. */
  function inside() {
    window.postMessage = function (data) { parent.postMessage(data, "*"); };
    window.importScripts = function () {
      return Array.prototype.reduce.call(arguments, function (before, url) {
        return before.then(function () {
          return new Promise(function (done) {
            var script = document.createElement("script");
            script.src = url;
            script.onload = done;
            document.body.appendChild(script);
          });
        });
      }, Promise.resolve());
    };
  }

  window.Worker = class extends EventTarget {
    constructor(url) {
      super();
      this.frame = document.createElement("iframe");
      this.frame.hidden = true;
      document.body.appendChild(this.frame);
      var page = this.frame.contentDocument, close = "</" + "script>";
      page.open();
      page.write("<html><body><script>(" + inside + ")()" + close +
        '<script src="' + url + '">' + close + "</body></html>");
      page.close();
      var frame = this.frame;
      this.ready = new Promise(function (done) { frame.contentWindow.onload = done; });
      window.addEventListener("message", this.heard = (event) => {
        if (event.source !== this.frame.contentWindow) return;
        var message = new MessageEvent("message", { data: event.data });
        this.dispatchEvent(message);
        if (this.onmessage) this.onmessage(message);
      });
    }

    postMessage(data) {
      this.ready.then(() => {
        this.frame.contentWindow.dispatchEvent(new MessageEvent("message", { data: data }));
      });
    }

    terminate() {
      window.removeEventListener("message", this.heard);
      this.frame.remove();
    }
  };
})();
