"""What a page does with keys and a gamepad: viser's client tells nobody of them."""

_SCRIPT = """
if (!window.pretouchKeys) {
  window.pretouchKeys = true;
  const ways = {
    KeyW: [1, 0, 0], KeyS: [-1, 0, 0], KeyA: [0, 1, 0], KeyD: [0, -1, 0], KeyE: [0, 0, 1], KeyQ: [0, 0, -1],
  };
  const held = new Set();
  const put = Object.getOwnPropertyDescriptor(HTMLInputElement.prototype, "value").set;
  const still = "0 0 0";
  let last = still, count = 0, driving = false;
  const field = () =>
    document.querySelector("label[for='UUID']")?.closest(".mantine-Flex-root")?.querySelector("input");
  const typing = (element) => element?.closest?.("input, textarea, select, [contenteditable]");
  const stick = (value) => (Math.abs(value) < 0.15 ? 0 : value);
  const asked = () => {
    const sum = [0, 0, 0];
    for (const key of held) ways[key].forEach((share, i) => (sum[i] += share));
    const pads = document.hidden ? [] : navigator.getGamepads?.() ?? [];
    // of another mapping nobody knows which axis is which, and a trigger at rest may be one at its end
    for (const pad of pads)
      if (pad?.connected && pad.mapping === "standard")
        [pad.axes[1], pad.axes[0], pad.axes[3]].forEach((value, i) => (sum[i] -= stick(value)));
    return sum.map((share) => Math.round(100 * Math.max(-1, Math.min(1, share))) || 0).join(" ");
  };
  const say = () => {
    const input = field();
    if (!input) {
      driving = false;
      return;
    }
    if (!driving) document.activeElement?.blur();  // of the list it was chosen from, where a key would be typed
    driving = true;
    const now = asked();
    if (now === still && last === still) return;
    last = now;
    count = (count + 1) % 100;
    put.call(input, `${now} ${count}`);
    input.dispatchEvent(new Event("input", {bubbles: true}));
  };
  const letGo = () => {
    held.clear();
    say();
  };
  addEventListener("keydown", (event) => {
    if (!(event.code in ways) || typing(event.target) || event.ctrlKey || event.metaKey || event.altKey) return;
    held.add(event.code);  // counts from when the arm is driven on: a slow page shows that late
    if (!field()) return;
    event.stopPropagation();  // else the camera moves too
    if (!event.repeat) say();
  }, true);
  addEventListener("keyup", (event) => held.delete(event.code) && say(), true);
  addEventListener("blur", letGo);
  document.addEventListener("visibilitychange", () => document.hidden && letGo());
  setInterval(say, 100);
}
"""
"""Says ten times a second, while keys or sticks are held, what they ask: per cent ahead, left and up, and a count. It
types that into a text of the page, so that it comes through the door as everything else does."""


def script(field: str) -> str:
    """Return the script that types into the control of an id."""
    return _SCRIPT.replace("UUID", field)
