/** Measured points with their intervals, drawn over a chart; each group has a shape of its own. */

import { colour } from "./colours.js";

const POINT_PX = 4;
/** How each group is drawn, so that they are told apart without colours, too. */
export const LOOKS = [
  { ink: "--trace-1", shape: "circle", sign: "●" },
  { ink: "--trace-2", shape: "square", sign: "■" },
  { ink: "--trace-3", shape: "triangle", sign: "▲" },
];
const SHAPES = {
  circle(ctx, x, y, r) {
    ctx.beginPath();
    ctx.arc(x, y, r, 0, 2 * Math.PI);
  },
  square(ctx, x, y, r) {
    ctx.beginPath();
    ctx.rect(x - r, y - r, 2 * r, 2 * r);
  },
  triangle(ctx, x, y, r) {
    ctx.beginPath();
    ctx.moveTo(x, y - 1.3 * r);
    ctx.lineTo(x + 1.2 * r, y + r);
    ctx.lineTo(x - 1.2 * r, y + r);
    ctx.closePath();
  },
};

/**
 * @param {uPlot} chart
 * @param {({ink: string, shape: string, points: {hz: number, db: number, low: number,
 *   high: number}[]}|null)[]} groups null: nothing of it is shown
 */
export function drawPoints(chart, groups) {
  const { ctx, bbox } = chart;
  ctx.save();
  ctx.setLineDash([]); // that of the last line holds still
  ctx.beginPath();
  ctx.rect(bbox.left, bbox.top, bbox.width, bbox.height);
  ctx.clip();
  for (const group of groups) {
    if (group === null) continue;
    ctx.fillStyle = ctx.strokeStyle = colour(group.ink);
    ctx.lineWidth = 1.5 * devicePixelRatio;
    for (const point of group.points) {
      const [x, y, top, bottom] = [
        chart.valToPos(point.hz, "x", true),
        ...[point.db, point.high, point.low].map((db) => chart.valToPos(db, "y", true)),
      ];
      ctx.beginPath();
      ctx.moveTo(x, top);
      ctx.lineTo(x, bottom);
      ctx.stroke();
      SHAPES[group.shape](ctx, x, y, POINT_PX * devicePixelRatio);
      ctx.fill();
    }
  }
  ctx.restore();
}
