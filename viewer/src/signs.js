// Signs in the view: dots, letters, the load, the approach, the flange frame, fixtures.

import {
  Box3, Box3Helper, BoxGeometry, BufferAttribute, BufferGeometry, CanvasTexture, ConeGeometry, CylinderGeometry, EdgesGeometry, GridHelper, Group, LineSegments, Matrix4, Mesh, MeshBasicMaterial, PlaneGeometry, SphereGeometry,
  Sprite, SpriteMaterial, TorusGeometry, Vector3,
} from 'three';

/** A moment below this share of force times the part's size is not drawn. */
const LEAST_MOMENT = 0.005;
const UP = new Vector3(0, 0, 1);

const vector = (list) => new Vector3(...list);

function canvas(size) {
  const made = document.createElement('canvas');
  made.width = made.height = size;
  return [made, made.getContext('2d')];
}

/** White on dark rims, to be coloured: a disc, a cross, or a square. */
export function dotTexture(shape) {
  const [made, context] = canvas(32);
  context.lineCap = 'round';
  if (shape === 'cross') {
    for (const [colour, width] of [['#555', 13], ['#fff', 7]]) {
      context.strokeStyle = colour;
      context.lineWidth = width;
      context.beginPath();
      for (const [from, to] of [[8, 24], [24, 8]]) {
        context.moveTo(from, 8);
        context.lineTo(to, 24);
      }
      context.stroke();
    }
    return new CanvasTexture(made);
  }
  if (shape === 'square') {
    context.fillStyle = '#555';
    context.fillRect(3, 3, 26, 26);
    context.fillStyle = '#fff';
    context.fillRect(7, 7, 18, 18);
    return new CanvasTexture(made);
  }
  context.fillStyle = '#fff';
  context.beginPath();
  context.arc(16, 16, 14.5, 0, 2 * Math.PI);
  context.fill();
  // A rim in the dot's own darker shade sets it off from the part.
  context.lineWidth = 4;
  context.strokeStyle = '#777';
  context.beginPath();
  context.arc(16, 16, 12.5, 0, 2 * Math.PI);
  context.stroke();
  return new CanvasTexture(made);
}

function letterTexture(letter, colour) {
  const [made, context] = canvas(64);
  context.font = '700 50px system-ui, sans-serif';
  context.textAlign = 'center';
  context.textBaseline = 'middle';
  context.lineWidth = 8;
  context.strokeStyle = '#fff';
  context.strokeText(letter, 32, 34);
  context.fillStyle = colour;
  context.fillText(letter, 32, 34);
  return new CanvasTexture(made);
}

/** A ring with a cross, where a body meets something. */
export function target(colour) {
  const [made, context] = canvas(64);
  for (const [ink, width] of [['#fff', 12], [colour, 6]]) {
    context.strokeStyle = ink;
    context.lineWidth = width;
    context.beginPath();
    context.arc(32, 32, 20, 0, 2 * Math.PI);
    for (const [dx, dy] of [[1, 0], [0, 1]]) {
      context.moveTo(32 - 28 * dx, 32 - 28 * dy);
      context.lineTo(32 + 28 * dx, 32 + 28 * dy);
    }
    context.stroke();
  }
  return new Sprite(new SpriteMaterial({ map: new CanvasTexture(made), sizeAttenuation: false, depthTest: false }));
}

/** The force of a load as an arrow, its moment as a turning arrow about its axis (right hand). */
export class LoadSign extends Group {
  constructor(material) {
    super();
    const [shaft, head] = [0.62, 0.38];
    this.force = new Group().add(
      new Mesh(new CylinderGeometry(0.028, 0.028, shaft, 16).translate(0, shaft / 2, 0), material),
      new Mesh(new ConeGeometry(0.1, head, 24).translate(0, shaft + head / 2, 0), material),
    );
    const turn = 1.5 * Math.PI;
    this.moment = new Group().add(
      new Mesh(new TorusGeometry(0.4, 0.024, 10, 48, turn), material),
      new Mesh(new ConeGeometry(0.085, 0.24, 24).rotateZ(-Math.PI / 2).translate(0.08, -0.4, 0), material),
    );
    this.add(this.force, this.moment, new Mesh(new SphereGeometry(0.055, 20, 14), material));
    this.traverse((object) => (object.renderOrder = 10));
  }

  /** Shows a wrench (SI, part frame) on a part of the size `size` [m]. */
  show({ force, moment }, size) {
    const [push, twist] = [vector(force), vector(moment)];
    const turns = twist.length() > LEAST_MOMENT * push.length() * size;
    this.visible = push.length() > 0 || turns;
    this.force.visible = push.length() > 0;
    this.moment.visible = turns;
    if (push.length() > 0) this.force.quaternion.setFromUnitVectors(new Vector3(0, 1, 0), push.normalize());
    if (turns) this.moment.quaternion.setFromUnitVectors(UP, twist.normalize());
    this.scale.setScalar(0.62 * size);
  }
}

/** The incipient motion of the part: an arrow where it slides, a turning arrow about an axis where it turns. */
export class MotionSign extends Group {
  constructor(material) {
    super();
    this.straight = new Group().add(
      new Mesh(new CylinderGeometry(0.02, 0.02, 1.1, 12).translate(0, 0.55, 0), material),
      new Mesh(new ConeGeometry(0.07, 0.26, 20).translate(0, 1.23, 0), material),
    );
    const turn = 1.6 * Math.PI;
    this.turning = new Group().add(
      new Mesh(new TorusGeometry(0.5, 0.02, 10, 48, turn), material),
      new Mesh(new ConeGeometry(0.07, 0.22, 20).rotateZ(-0.1 * Math.PI).translate(0.5 * Math.cos(turn) + 0.06, 0.5 * Math.sin(turn) + 0.09, 0), material),
    );
    // The axis in dashes, both ways from where it passes the middle of the grip.
    for (let k = -5; k <= 5; k++) this.turning.add(new Mesh(new CylinderGeometry(0.014, 0.014, 0.17, 8).rotateX(Math.PI / 2).translate(0, 0, 0.29 * k), material));
    this.add(this.straight, this.turning);
    this.traverse((object) => (object.renderOrder = 11));
  }

  /** Shows `motion` (see `motionOf`), with arrows of the size `size` [m]. */
  show(motion, size) {
    this.visible = this.drawn = Boolean(motion.direction ?? motion.axis);
    this.straight.visible = Boolean(motion.direction);
    this.turning.visible = Boolean(motion.axis);
    this.scale.setScalar(size);
    this.position.set(...(motion.foot ?? [0, 0, 0]));
    if (motion.direction) this.straight.quaternion.setFromUnitVectors(new Vector3(0, 1, 0), vector(motion.direction));
    if (motion.axis) this.turning.quaternion.setFromUnitVectors(UP, vector(motion.axis));
  }
}

/** An arrow along x1 that ends before the pads; `length` and `pad` [m]. */
export function approachSign(material, length, pad) {
  const arrow = new Group().add(
    new Mesh(new CylinderGeometry(0.013, 0.013, 0.7, 12).translate(0, 0.35, 0), material),
    new Mesh(new ConeGeometry(0.045, 0.3, 20).translate(0, 0.85, 0), material),
  );
  arrow.traverse((object) => (object.renderOrder = 9));
  arrow.scale.setScalar(length);
  arrow.rotation.z = -Math.PI / 2;
  arrow.position.x = -length - 1.2 * pad;
  return arrow;
}

/** The axes of a frame given as a column-major matrix; letters `size` high in the view's units. */
export function frameSign(matrix, size) {
  const frame = new Group();
  const reach = 0.03;
  for (const [k, [name, colour]] of [['x', '#d0453b'], ['y', '#3f9b46'], ['z', '#3b7fd9']].entries()) {
    const material = new MeshBasicMaterial({ color: colour, depthTest: false, transparent: true });
    const axis = new Mesh(new CylinderGeometry(0.0007, 0.0007, reach, 8).translate(0, reach / 2, 0), material);
    axis.quaternion.setFromUnitVectors(new Vector3(0, 1, 0), new Vector3().setComponent(k, 1));
    const letter = new Sprite(new SpriteMaterial({ map: letterTexture(name, colour), sizeAttenuation: false, depthTest: false }));
    letter.scale.setScalar(size);
    letter.position.setComponent(k, 1.2 * reach);
    frame.add(axis, letter);
  }
  frame.traverse((object) => (object.renderOrder = 9));
  frame.applyMatrix4(new Matrix4().fromArray(matrix));
  return frame;
}

/** A shape of an obstacle of the scene; a plane is drawn `size` wide. */
function obstacleShape(shape, column, size) {
  if (shape.type === 'box') return new BoxGeometry(...shape.half.map((half) => 2 * half));
  if (shape.type === 'plane') return new PlaneGeometry(size, size);
  const cut = (name, [first, length]) => column[name].subarray(first, first + length);
  const surface = new BufferGeometry().setAttribute('position', new BufferAttribute(cut('obstacle_points', shape.points), 3));
  surface.setIndex(new BufferAttribute(cut('obstacle_triangles', shape.triangles), 1));
  return surface;
}

/** The ground, the boxes to keep out of, and the obstacles of the scene; `middle` and `radius` of the part [m]. */
export function fixtures({ header, column }, middle, radius, materials) {
  const { ground, keep_out: boxes } = header.asked;
  const group = new Group();
  const size = 4 * radius;
  const grid = () => {
    const lines = new GridHelper(size, 16).rotateX(Math.PI / 2);
    lines.material = materials.fixtureEdge;
    return lines;
  };
  if (ground) {
    const normal = vector(ground.normal).normalize();
    const centre = middle.clone();
    centre.addScaledVector(normal, ground.height_m - centre.dot(normal));
    const plane = new Group().add(new Mesh(new PlaneGeometry(size, size), materials.fixture), grid());
    plane.quaternion.setFromUnitVectors(UP, normal);
    plane.position.copy(centre);
    group.add(plane);
  }
  for (const { name, matrix, shape } of header.obstacles.list) {
    const obstacle = new Group();
    const geometry = obstacleShape(shape, column, size);
    obstacle.add(new Mesh(geometry, materials.fixture), shape.type === 'plane' ? grid() : new LineSegments(new EdgesGeometry(geometry, 30), materials.fixtureEdge));
    obstacle.userData.obstacle = name;
    obstacle.applyMatrix4(new Matrix4().fromArray(matrix));
    // A plane has no middle of its own: it is drawn under the part's.
    if (shape.type === 'plane') {
      const normal = new Vector3(0, 0, 1).applyQuaternion(obstacle.quaternion);
      const height = normal.dot(obstacle.position) - normal.dot(middle);
      obstacle.position.copy(middle).addScaledVector(normal, height);
    }
    group.add(obstacle);
  }
  for (const [low, high] of boxes ?? []) {
    const box = new Box3(vector(low), vector(high));
    const helper = new Box3Helper(box);
    helper.material = materials.fixtureEdge;
    const solid = new Mesh(new BoxGeometry(...box.getSize(new Vector3()).toArray()), materials.fixture);
    solid.position.copy(box.getCenter(new Vector3()));
    group.add(helper, solid);
  }
  return group;
}
