// What stands in the page: base64 blocks, deflated: one of them JSON that names the others.
export async function bytes(id) {
  const packed = Uint8Array.from(atob(document.getElementById(id).textContent), (letter) => letter.charCodeAt(0));
  const stream = new Blob([packed]).stream().pipeThrough(new DecompressionStream("deflate"));
  return new Uint8Array(await new Response(stream).arrayBuffer());
}

export async function readData() {
  return JSON.parse(new TextDecoder().decode(await bytes("data")));
}

// Points (x, y, z one after the other, metres, level frame) from columns, rows and depths as the camera saw them: the
// steps between neighbours, coordinate by coordinate, all low bytes before all high ones.
async function points(id, run) {
  const halves = await bytes(id);
  const count = halves.length / 6;
  const seen = [0, 1, 2].map((axis) => {
    let sum = 0;
    return Int16Array.from({ length: count }, (_, i) => {
      const at = axis * count + i;
      return (sum += halves[at] | (halves[3 * count + at] << 8)); // wraps as 16 bits do
    });
  });
  const [fx, fy, cx, cy] = run.lens;
  const out = new Float32Array(3 * count);
  for (let i = 0; i < count; i++) {
    const z = seen[2][i] * run.unit;
    const x = ((seen[0][i] - cx) * z) / fx;
    const y = ((seen[1][i] - cy) * z) / fy;
    run.to_level.forEach((row, axis) => (out[3 * i + axis] = row[0] * x + row[1] * y + row[2] * z));
  }
  return out;
}

// The film, its first picture, the GLB file, and points: those of every frame one after the other, and those of the room.
export async function unpack(run) {
  return {
    film: run.film && (await bytes(run.film)),
    poster: run.poster && (await bytes(run.poster)),
    glb: (await bytes(run.glb)).buffer,
    points: run.points ? await points(run.points, run) : new Float32Array(0),
    room: run.room ? await points(run.room, run) : new Float32Array(0),
  };
}
