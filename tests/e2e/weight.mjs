// @ts-check
// `node tests/e2e/weight.mjs <url>`: prints the bytes of everything that a page loads.

import { Participant } from "./browser.mjs";

await Participant.with("weight", "artefacts/e2e", async (who) => {
  const page = await who.tab();
  let bytes = 0;
  page.on("response", async (response) => {
    bytes += (await response.body().catch(() => Buffer.alloc(0))).length;
  });
  await page.goto(process.argv[2] ?? "", { waitUntil: "networkidle" });
  console.log(bytes);
});
