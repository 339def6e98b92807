/** What the traces show as files: a table of values, and a picture. */

import { colour } from "../canvas/colours.js";

const ROOM_PX = 28;

/**
 * Everything that is kept of what is shown, a row for each column of 4 ms.
 *
 * @param {import("./trace.js").Trace[]} traces
 * @param {import("./time_axis.js").TimeAxis} axis
 * @returns {Blob} comma-separated: when a column begins, s since the device's first sample, and the
 *   least and greatest value of each channel in it; empty where nothing was received
 */
export function table(traces, axis) {
  const columnS = Math.max(...traces.map(({ history }) => history.columnS));
  const lines = traces.flatMap(({ history, shown }) =>
    shown.channels.map((name, channel) => ({ history, channel, of: `${shown.title} ${name}`, unit: shown.unit })),
  );
  const head = lines.flatMap(({ of, unit }) => [`least ${of} (${unit})`, `greatest ${of} (${unit})`]);
  const rows = [["begin (s)", ...head].join()];
  const end = Math.round(axis.endS / columnS);
  for (let column = end - Math.round(axis.windowS / columnS); column < end; column++) {
    const beginS = column * columnS;
    const values = lines.flatMap(({ history, channel }) => {
      const from = Math.round(beginS / history.columnS);
      return history.extent(channel, from, from + 1) ?? ["", ""];
    });
    if (values.some((value) => value !== "")) rows.push([beginS.toFixed(6), ...values].join());
  }
  return new Blob([`${rows.join("\n")}\n`], { type: "text/csv" });
}

/**
 * The charts as they are, one below the other.
 *
 * @param {import("./trace.js").Trace[]} traces
 * @param {string} title
 * @returns {Promise<Blob>} PNG
 */
export function picture(traces, title) {
  const canvases = traces.map(({ chart }) => chart.ctx.canvas);
  const room = ROOM_PX * devicePixelRatio;
  const sheet = document.createElement("canvas");
  sheet.width = Math.max(...canvases.map(({ width }) => width));
  sheet.height = canvases.reduce((sum, { height }) => sum + height + room, room);
  const pen = sheet.getContext("2d");
  pen.fillStyle = colour("--card");
  pen.fillRect(0, 0, sheet.width, sheet.height);
  pen.fillStyle = colour("--ink");
  pen.font = `600 ${0.5 * room}px system-ui, sans-serif`;
  pen.textBaseline = "middle";
  pen.fillText(title, room / 2, room / 2);
  let top = room;
  traces.forEach(({ shown }, i) => {
    pen.fillText(`${shown.title}, ${shown.unit}`, room / 2, top + room / 2);
    pen.drawImage(canvases[i], 0, top + room);
    top += room + canvases[i].height;
  });
  return new Promise((resolve) => sheet.toBlob(resolve));
}
