// Body, joints, measured points and room in the level frame: metres, y up, the camera at the origin.
import {
  AnimationMixer, BufferAttribute, BufferGeometry, CanvasTexture, Color, DirectionalLight, GridHelper, Group,
  HemisphereLight, LineBasicMaterial, LineSegments, PerspectiveCamera, Points, PointsMaterial, Scene as Space,
  Sprite, SpriteMaterial, Vector2, Vector3, WebGLRenderer,
} from "three";
import { OrbitControls } from "three/addons/controls/OrbitControls.js";
import { GLTFLoader } from "three/addons/loaders/GLTFLoader.js";

const MILLIMETRE = 0.001;
const JOINT_SIZE = 0.045; // metres
const EMPTY = 2;
const BEHIND = 2000; // of the depth buffer: the body lies some 2 cm behind itself, so that points on it are seen

// A filled disc for a joint that was observed, a ring for one without a measurement.
function disc(filled) {
  const canvas = document.createElement("canvas");
  canvas.width = canvas.height = 64;
  const pen = canvas.getContext("2d");
  pen.lineWidth = 12;
  pen.strokeStyle = pen.fillStyle = "#fff";
  pen.beginPath();
  pen.arc(32, 32, 24, 0, 2 * Math.PI);
  if (filled) pen.fill();
  else pen.stroke();
  return new CanvasTexture(canvas);
}

function pointCloud(values, size, color) {
  const geometry = new BufferGeometry();
  geometry.setAttribute("position", new BufferAttribute(values, 3));
  return new Points(geometry, new PointsMaterial({ size, color, sizeAttenuation: true }));
}

// The camera that recorded: its image plane 30 cm in front of it.
function cameraPyramid([fx, fy, cx, cy, width, height], toLevel) {
  const corners = [[0, 0], [width, 0], [width, height], [0, height]].map(([u, v]) => {
    const [x, y, z] = [(0.3 * (u - cx)) / fx, (0.3 * (v - cy)) / fy, 0.3];
    return toLevel.map((row) => row[0] * x + row[1] * y + row[2] * z);
  });
  const lines = corners.flatMap((corner, i) => [[0, 0, 0], corner, corner, corners[(i + 1) % 4]]);
  const geometry = new BufferGeometry();
  geometry.setAttribute("position", new BufferAttribute(new Float32Array(lines.flat()), 3));
  return new LineSegments(geometry, new LineBasicMaterial({ color: 0x8a93a3 }));
}

class Figure {
  // Joints and bones of one person, and the joints' names.
  constructor(person, run, textures, labels) {
    this._person = person;
    this._run = run;
    this._textures = textures;
    this.group = new Group();
    this._sprites = run.joint_names.map((name, j) => {
      const sprite = new Sprite(new SpriteMaterial({ color: new Color(person.joint_colors[j]), depthTest: false }));
      sprite.scale.setScalar(JOINT_SIZE);
      sprite.renderOrder = 3;
      this.group.add(sprite);
      return sprite;
    });
    const geometry = new BufferGeometry();
    geometry.setAttribute("position", new BufferAttribute(new Float32Array(run.bones.length * 6), 3));
    this._bones = new LineSegments(geometry, new LineBasicMaterial({ color: person.color, depthTest: false }));
    this._bones.frustumCulled = false;
    this._bones.renderOrder = 2;
    this.group.add(this._bones);
    this._labels = run.joint_names.map((name) => {
      const label = labels.appendChild(document.createElement("span"));
      label.textContent = name.replaceAll("_", " ");
      return label;
    });
  }

  draw(frame, showsNames, camera, width, height) {
    const there = this._person.state[frame] !== EMPTY;
    this.group.visible = there && this.wanted;
    const joints = this._person.joints[frame];
    const at = joints && this._sprites.map((_, j) => new Vector3(...joints.slice(3 * j, 3 * j + 3)).multiplyScalar(MILLIMETRE));
    this._labels.forEach((label) => (label.hidden = true));
    if (!there || !at) return;
    this._sprites.forEach((sprite, j) => {
      const seen = this._person.observed[frame][j] === "1";
      sprite.position.copy(at[j]);
      const texture = this._textures[seen ? 1 : 0];
      if (sprite.material.map !== texture) {
        sprite.material.map = texture;
        sprite.material.needsUpdate = true;
      }
      if (!showsNames) return;
      const place = at[j].clone().project(camera);
      const label = this._labels[j];
      label.hidden = Math.abs(place.x) > 1 || Math.abs(place.y) > 1 || place.z > 1;
      label.classList.toggle("inferred", !seen);
      label.style.transform = `translate(${((place.x + 1) / 2) * width + 7}px, ${((1 - place.y) / 2) * height - 7}px)`;
    });
    const ends = this._bones.geometry.attributes.position;
    this._run.bones.flat().forEach((j, i) => ends.setXYZ(i, at[j].x, at[j].y, at[j].z));
    ends.needsUpdate = true;
  }
}

export class Scene {
  static async make(canvas, labels, run, blocks) {
    const gltf = await new GLTFLoader().parseAsync(blocks.glb, "");
    return new Scene(canvas, labels, run, blocks, gltf);
  }

  constructor(canvas, labels, run, blocks, gltf) {
    this._canvas = canvas;
    this._labels = labels;
    this._blocks = blocks;
    this._starts = run.point_counts.reduce((sums, count) => [...sums, sums[sums.length - 1] + count], [0]);
    this._renderer = new WebGLRenderer({ canvas, antialias: true });
    this._space = new Space();
    this._space.background = new Color(0x14161c);
    this._space.add(new HemisphereLight(0xffffff, 0x445066, 1.6));
    const lamp = new DirectionalLight(0xffffff, 2.0);
    lamp.position.set(-2, 4, 3);
    this._space.add(lamp);
    this._eye = new PerspectiveCamera(45, 1, 0.05, 60);
    this._controls = new OrbitControls(this._eye, canvas);
    this._home = run.view;
    this.resetView();

    gltf.scene.traverse((node) => {
      node.frustumCulled = false;
      if (node.material) Object.assign(node.material, { polygonOffset: true, polygonOffsetUnits: BEHIND });
    });
    this._mixer = new AnimationMixer(gltf.scene);
    gltf.animations.forEach((clip) => this._mixer.clipAction(clip).play());
    this._end = Math.max(...gltf.animations.map((clip) => clip.duration)) - 1e-4; // at its very end it begins again
    const textures = [disc(false), disc(true)];
    this._figures = run.people.map((person) => new Figure(person, run, textures, labels));
    const figures = new Group();
    figures.add(...this._figures.map((figure) => figure.group));
    this._points = pointCloud(new Float32Array(3 * Math.max(1, ...run.point_counts)), 0.018, 0x96e6be);
    this._points.frustumCulled = false;
    const room = new Group();
    room.add(pointCloud(blocks.room, 0.02, 0x5f6b80), cameraPyramid(run.lens, run.to_level));
    const grid = new GridHelper(6, 12, 0x39414f, 0x262c37);
    grid.position.set(run.view.target[0], run.floor, run.view.target[2]);
    room.add(grid);
    this._parts = { body: gltf.scene, points: this._points, room, joints: figures };
    this._space.add(...Object.values(this._parts));
    this._showsNames = false;
  }

  setVisible(part, visible) {
    if (part === "names") this._showsNames = visible;
    else if (part === "joints") this._figures.forEach((figure) => (figure.wanted = visible));
    else this._parts[part].visible = visible;
  }

  resetView() {
    this._eye.position.set(...this._home.from);
    this._controls.target.set(...this._home.target);
    this._controls.update();
  }

  draw(frame, time) {
    const { clientWidth: width, clientHeight: height } = this._canvas;
    const size = this._renderer.getSize(new Vector2());
    if (size.x !== width || size.y !== height) {
      this._renderer.setPixelRatio(Math.min(devicePixelRatio, 2));
      this._renderer.setSize(width, height, false);
      this._eye.aspect = width / Math.max(height, 1);
      this._eye.updateProjectionMatrix();
    }
    this._mixer.setTime(Math.min(time, this._end));
    this._showPoints(frame);
    this._eye.updateMatrixWorld();
    this._figures.forEach((figure) => figure.draw(frame, this._showsNames, this._eye, width, height));
    this._renderer.render(this._space, this._eye);
  }

  _showPoints(frame) {
    if (frame === this._shown) return;
    this._shown = frame;
    const [start, end] = [this._starts[frame] ?? 0, this._starts[frame + 1] ?? 0];
    const target = this._points.geometry.attributes.position;
    target.array.set(this._blocks.points.subarray(3 * start, 3 * end));
    target.needsUpdate = true;
    this._points.geometry.setDrawRange(0, end - start);
  }

  dispose() {
    this._controls.dispose();
    this._labels.replaceChildren();
    this._renderer.dispose();
  }
}
