// Prints what the Khronos validator finds in glTF files as JSON; exit code 1 if it finds errors or warnings.
import { readFileSync } from "node:fs";
import validator from "gltf-validator";

let found = 0;
for (const file of process.argv.slice(2)) {
  const report = await validator.validateBytes(new Uint8Array(readFileSync(file)));
  const { numErrors, numWarnings, numInfos, numHints, messages } = report.issues;
  found += numErrors + numWarnings;
  console.log(JSON.stringify({ file, numErrors, numWarnings, numInfos, numHints, messages, info: report.info }));
}
process.exit(found ? 1 : 0);
