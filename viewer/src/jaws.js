// The gripper as three.js objects, in metres, in the grip frame (x1 approach, x3 closing).

import {
  Box3, BoxGeometry, BufferGeometry, Color, CylinderGeometry, EdgesGeometry, ExtrudeGeometry, Float32BufferAttribute, Group, LineSegments,
  Matrix4, Mesh, Path, Shape, ShapeGeometry, Vector3,
} from 'three';
import { pressure as scale } from './colour.js';
import { gapAt, inside } from './pads.js';
import { ConvexGeometry } from 'three/examples/jsm/geometries/ConvexGeometry.js';

/** Depth at which a pad of unknown thickness is drawn [m]. */
const PAD_DEPTH = 0.002;
/** Cells along each side of a piece of surface. */
const CELLS = 96;

function bodyGeometry(shape) {
  if (shape.type === 'box') return new BoxGeometry(...shape.half.map((h) => 2 * h));
  if (shape.type === 'hull') return new ConvexGeometry(shape.points.map((point) => new Vector3(...point)));
  // three.js cylinders stand along y, the gripper file's along z.
  return new CylinderGeometry(shape.radius, shape.radius, 2 * shape.half_height, 40).rotateX(Math.PI / 2);
}

function body(description, surface, materials) {
  const geometry = bodyGeometry(description.shape);
  const group = new Group();
  // First the depth alone: of several surfaces behind each other only the nearest is then shaded.
  const layers = [new Mesh(geometry, materials.jawDepth), new Mesh(geometry, surface), new LineSegments(new EdgesGeometry(geometry, 30), materials.jawEdge)];
  layers.forEach((layer, k) => (layer.renderOrder = 2 + k));
  group.add(...layers);
  group.userData.body = description.name;
  group.applyMatrix4(new Matrix4().fromArray(description.matrix));
  return group;
}

/** The pad of a jaw in the jaw's own frame: that of jaw II is half a turn from the grip's. */
function pad(gripper, side, materials) {
  const ring = side === 0 ? gripper.pad : (gripper.pad_ii ?? gripper.pad).map(([x, y]) => [x, -y]).reverse();
  const geometry = new ExtrudeGeometry(new Shape(ring.map(([x, y]) => ({ x, y }))), { depth: gripper.pad_thickness || PAD_DEPTH, bevelEnabled: false });
  const group = new Group();
  group.add(new Mesh(geometry, materials.pad), new LineSegments(new EdgesGeometry(geometry, 30), materials.padEdge));
  return group;
}

/** The pressed part of a face that is not plane, coloured by the pressure, in the frame of its pad plane. */
function pressed(state, face) {
  const largest = Math.max(state.largest(0), state.largest(1));
  const [places, colours] = [[], []];
  const ink = new Color();
  for (const piece of state.of(face)) {
    const corners = piece.rings[0].points;
    const [left, right, low, high] = [0, 1].flatMap((k) => [Math.min(...corners.map((p) => p[k])), Math.max(...corners.map((p) => p[k]))]);
    const [dx, dy] = [(right - left) / CELLS, (high - low) / CELLS];
    for (let column = 0; column < CELLS; column++) {
      for (let row = 0; row < CELLS; row++) {
        const [x, y] = [left + (column + 0.5) * dx, low + (row + 0.5) * dy];
        const p = state.on(piece, x, y);
        if (!(p > 0) || !inside(piece.rings, x, y)) continue;
        const [r, g, b] = scale(p / largest);
        ink.setRGB(r / 255, g / 255, b / 255, 'srgb');
        const corner = [[-1, -1], [1, -1], [1, 1], [-1, 1]].map(([a, c]) => [x + (a * dx) / 2, y + (c * dy) / 2]);
        for (const k of [0, 1, 2, 0, 2, 3]) {
          const [cx, cy] = corner[k];
          places.push(cx, cy, (face ? 1 : -1) * gapAt(piece.gap, cx, cy));
          colours.push(ink.r, ink.g, ink.b);
        }
      }
    }
  }
  return new BufferGeometry().setAttribute('position', new Float32BufferAttribute(places, 3)).setAttribute('color', new Float32BufferAttribute(colours, 3));
}

/** Two fingers, a palm and the contact areas; `place` opens the jaws. */
export class Jaws {
  constructor(gripper, materials) {
    this.materials = materials;
    this.root = new Group();
    this.fingers = [new Group(), new Group()];
    this.solid = new Group();
    this.moving = gripper?.moving ?? 'both';
    for (const [k, side] of this.fingers.entries()) {
      const finger = new Group();
      if (gripper) {
        finger.add(pad(gripper, k, materials));
        const bodies = k === 0 ? gripper.fingers : (gripper.fingers_ii ?? gripper.fingers);
        bodies.forEach((description) => finger.add(body(description, materials.jaw, materials)));
      }
      side.add(finger);
      this.solid.add(side);
    }
    // The other finger is the first one turned by 180 degrees about the approach axis.
    this.fingers[1].children[0].rotation.x = Math.PI;
    this.palm = new Group();
    gripper?.palm.forEach((description) => this.palm.add(body(description, materials.palm, materials)));
    this.solid.add(this.palm);
    this.contacts = [new Group(), new Group()];
    this.root.add(this.solid, ...this.contacts);
  }

  /**
   * Pads at `opening`, contact areas on the faces at `width` [m], which is negative for a grip from inside. `palm`: where
   * the palm stands along x1 and x3 in a grip with the pads `gap` apart; a fixed jaw stays there. `ahead`: how far the
   * pads of two moving jaws stand along x1 from where they are in the grip.
   */
  place(opening, width, palm = { x: 0, z: { I: -0.5, II: 0.5 }[this.moving] * opening || 0, gap: opening }, ahead = 0) {
    const alone = opening - palm.gap / 2;
    this.fingers[0].position.z = { I: alone, II: palm.gap / 2 }[this.moving] ?? opening / 2;
    this.fingers[1].position.z = -({ I: palm.gap / 2, II: alone }[this.moving] ?? opening / 2);
    this.palm.position.set(palm.x, 0, palm.z);
    if (this.moving === 'both') for (const finger of this.fingers) finger.position.x = ahead;
    if (this.moving !== 'both') {
      // A jaw on a crank alone: the grip's middle lies between the pads.
      const own = this.moving === 'I' ? -palm.x : palm.x;
      this.fingers[0].position.x = own;
      this.fingers[1].position.x = -own;
    }
    this.contacts[0].position.z = width / 2;
    this.contacts[1].position.z = -width / 2;
  }

  /** Corners of the box about fingers and palm, in the frame that this stands in [m]. */
  corners() {
    this.root.updateMatrixWorld(true);
    const scale = this.root.parent?.matrixWorld.clone().invert() ?? new Matrix4();
    const box = new Box3().setFromObject(this.solid).applyMatrix4(scale);
    if (box.isEmpty()) return [];
    const { min, max } = box;
    return [min.x, max.x].flatMap((x) => [min.y, max.y].flatMap((y) => [min.z, max.z].map((z) => new Vector3(x, y, z))));
  }

  /** Shows what the pads of a grip touch: `state` of `Report.state`, `rings` of `Report.contact`. */
  setContact(rings, state) {
    for (const face of [0, 1]) {
      const group = this.contacts[face];
      group.children.forEach((child) => child.geometry.dispose());
      group.clear();
      if (state.pieces && state.known) {
        group.add(new Mesh(pressed(state, face), this.materials.pressed));
        continue;
      }
      let shape = null;
      const shapes = [];
      const outline = [];
      for (const ring of rings.filter((ring) => ring.face === face && ring.points.length > 2)) {
        const points = ring.points.map(([x, y]) => ({ x, y }));
        if (ring.hole) shape?.holes.push(new Path(points));
        else shapes.push((shape = new Shape(points)));
        points.forEach((from, k) => {
          const to = points[(k + 1) % points.length];
          outline.push(from.x, from.y, 0, to.x, to.y, 0);
        });
      }
      if (shapes.length === 0) continue;
      const line = new BufferGeometry().setAttribute('position', new Float32BufferAttribute(outline, 3));
      group.add(new Mesh(new ShapeGeometry(shapes), this.materials.contact), new LineSegments(line, this.materials.contactEdge));
    }
  }
}

