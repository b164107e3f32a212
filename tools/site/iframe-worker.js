// A browser starts no worker for a page of the file system: the search then runs in a frame without a page. Messages
// are copied, as between threads: the search changes what it is given, which would empty the field while one types.
if (location.protocol === "file:") {
  window.Worker = class extends EventTarget {
    constructor(url) {
      super()
      this.onmessage = null
      this.frame = document.createElement("iframe")
      this.frame.hidden = true
      document.body.append(this.frame)
      const inside = this.frame.contentWindow
      inside.postMessage = (data) => {
        const event = new MessageEvent("message", { data: structuredClone(data) })
        this.onmessage?.(event)
        this.dispatchEvent(event)
      }
      const script = inside.document.createElement("script")
      this.loaded = new Promise((resolve) => script.addEventListener("load", resolve))
      script.src = url
      inside.document.body.append(script)
    }
    postMessage(data) {
      const event = new MessageEvent("message", { data: structuredClone(data) })
      this.loaded.then(() => this.frame.contentWindow.dispatchEvent(event))
    }
    terminate() {
      this.frame.remove()
    }
  }
}
