// What stands in the page: one JSON document, and base64 blocks that it names.
export function readData() {
  return JSON.parse(document.getElementById("data").textContent);
}

export function bytes(id) {
  const text = atob(document.getElementById(id).textContent.trim());
  return Uint8Array.from(text, (letter) => letter.charCodeAt(0));
}

// Points (x, y, z one after the other, in metres) from the steps between them, coordinate by coordinate.
async function points(id, unit) {
  const stream = new Blob([bytes(id)]).stream().pipeThrough(new DecompressionStream("deflate"));
  const steps = new Int16Array(await new Response(stream).arrayBuffer());
  const count = steps.length / 3;
  const out = new Float32Array(steps.length);
  for (let axis = 0; axis < 3; axis++) {
    let sum = 0;
    for (let i = 0; i < count; i++) {
      sum = ((sum + steps[axis * count + i]) << 16) >> 16; // wraps as 16 bits do
      out[3 * i + axis] = sum * unit;
    }
  }
  return out;
}

// The GLB file, and points: those of every frame one after the other, and those of the room.
export async function unpack(run) {
  return {
    glb: bytes(run.glb).buffer,
    points: run.points ? await points(run.points, run.unit) : new Float32Array(0),
    room: run.room ? await points(run.room, run.unit) : new Float32Array(0),
  };
}
