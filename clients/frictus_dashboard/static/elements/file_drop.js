/** Files that are dropped anywhere on the page; where they go is marked while they are dragged. */

/**
 * Take what is dropped.
 *
 * @param {Element} into where it goes
 * @param {(files: FileList) => void} take is given what was dropped
 * @param {AbortSignal} signal until then
 */
export function takeDrops(into, take, signal) {
  const files = (event) => event.dataTransfer?.types.includes("Files");
  const mark = (dropping) => into.toggleAttribute("data-dropping", dropping);
  const over = (event) => {
    if (!files(event)) return;
    event.preventDefault(); // or the browser would leave the page for the file
    event.dataTransfer.dropEffect = "copy";
    mark(true);
  };
  const leave = ({ relatedTarget }) => {
    if (relatedTarget === null) mark(false); // of the window
  };
  const drop = (event) => {
    if (!files(event)) return;
    event.preventDefault();
    mark(false);
    take(event.dataTransfer.files);
  };
  document.addEventListener("dragover", over, { signal });
  document.addEventListener("dragleave", leave, { signal });
  document.addEventListener("drop", drop, { signal });
  signal.addEventListener("abort", () => mark(false));
}
