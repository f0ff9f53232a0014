// Where the robot is and has been reaches everybody who looks at the map that it makes, also who comes later.
import assert from "node:assert/strict";
import { test } from "node:test";
import { SpectraClient } from "./spectra_client.mjs";
import { serve } from "./spectra_server.mjs";

const ways = (client) => {
  let way = [];
  for (const { method, params } of client.notifications) {
    if (method !== "robot.moved") continue;
    assert.ok(params.path.first <= way.length, "a part of the way is missing");
    way = [...way.slice(0, params.path.first), ...params.path.points];
  }
  return way;
};
const last = (client) => client.notifications.filter(({ method }) => method === "robot.moved").at(-1).params;

test("a viewer is told where the robot is and the way it has come, whenever he comes", async () => {
  const server = await serve(["--demo-drive"]);
  const first = await SpectraClient.connect(server.url);
  assert.ok(first.hello.capabilities.includes("robot"));
  const begin = await first.notification("robot.moved");
  await first.notification("robot.moved", 60_000, ({ path }) => path.first > 3);
  const second = await SpectraClient.connect(server.url);
  await second.notification("robot.moved", 60_000, ({ at }) => at > begin.at + 0.5);
  await first.notification("robot.moved");

  const way = ways(first);
  assert.ok(way.length > 4, `${way.length}`);
  const late = ways(second);
  assert.deepEqual(late.slice(0, 4), way.slice(0, 4), "the way begins where it began");
  for (let i = 1; i < way.length; i += 1) {
    const step = Math.hypot(...way[i].map((value, axis) => value - way[i - 1][axis]));
    assert.ok(step >= 0.045 && step < 1, `a step of ${step} m`);
  }
  const { position, forward, up, at, lost } = last(first);
  assert.equal(lost, undefined);
  assert.ok(Math.abs(Math.hypot(...forward) - 1) < 0.003 && Math.abs(Math.hypot(...up) - 1) < 0.003);
  assert.ok(up[1] > 0.7, "the room of the drive has y upwards");
  assert.ok(Math.abs(Date.now() / 1000 - at) < 30, "Unix seconds, near now");
  assert.ok(Math.hypot(...position.map((value, axis) => value - way.at(-1)[axis])) < 0.5);
  await first.close();
  await second.close();
  await server.stop();
});

test("nobody is told of a robot where there is none", async () => {
  const server = await serve(["--live"]);
  const client = await SpectraClient.connect(server.url);
  await client.request("fusion.get");
  assert.ok(!client.notifications.some(({ method }) => method === "robot.moved"));
  await client.close();
  await server.stop();
});
