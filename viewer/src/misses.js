// Rejected candidates in the view: dots by reason, and one of them with the body that stops it.

import { BufferAttribute, BufferGeometry, Color, Float32BufferAttribute, Group, LineBasicMaterial, LineSegments, Matrix4, MeshStandardMaterial, Points, PointsMaterial, Vector3 } from 'three';
import { HIT, reasonColour } from './colour.js';
import { gapsOf, palmAlong } from './take.js';
import { dotTexture, target } from './signs.js';

const MM = 1000;

const vector = (list) => new Vector3(...list);
const basis = ({ x1, x2, x3 }) => new Matrix4().makeBasis(vector(x1), vector(x2), vector(x3));

export class Misses {
  constructor(report, jaws, fixtures) {
    Object.assign(this, { report, jaws, fixtures, shown: -1 });
    this.group = new Group();
    this.marks = new Group();
    this.hit = new MeshStandardMaterial({ color: HIT, roughness: 0.6, transparent: true, opacity: 0.8, depthWrite: false });
    this.line = new LineBasicMaterial({ color: HIT, depthTest: false, transparent: true });
    this.target = target(HIT);
    this.target.scale.setScalar(0.032 / MM);
    this.target.renderOrder = 12;
    this.marks.add(this.target);
    this.marks.visible = false;
    this.dots();
    this.group.add(this.points, this.marks);
  }

  /** Both pad centres of each candidate, coloured by the reason. */
  dots() {
    const { report } = this;
    this.of = [];
    const [places, colours] = [[], []];
    for (let k = 0; k < report.misses; k++) {
      const { reason, origin, x3, width } = report.miss(k);
      if (reason.startsWith('face_pair')) continue;
      const { r, g, b } = new Color(reasonColour(report, reason));
      for (const side of [0.5, -0.5]) {
        this.of.push(k);
        places.push(...origin.map((v, n) => v + side * width * x3[n]));
        colours.push(r * 255, g * 255, b * 255);
      }
    }
    const geometry = new BufferGeometry();
    geometry.setAttribute('position', new Float32BufferAttribute(places, 3));
    geometry.setAttribute('color', new BufferAttribute(Uint8Array.from(colours), 3, true));
    this.points = new Points(geometry, new PointsMaterial({ size: 7, sizeAttenuation: false, vertexColors: true, map: dotTexture('square'), alphaTest: 0.35, transparent: true }));
    this.points.frustumCulled = false;
    this.points.visible = false;
  }

  /** Stands the gripper at candidate `k` (-1: none any more), marks the body that stops it and the place. */
  show(k) {
    for (const [layer, material] of this.painted ?? []) layer.material = material;
    this.painted = [];
    this.shown = k;
    this.marks.visible = k >= 0;
    if (k < 0) return;
    const { report, jaws } = this;
    const { gripper } = report.header;
    const miss = report.miss(k);
    jaws.root.visible = Boolean(gripper);
    jaws.root.quaternion.setFromRotationMatrix(basis(miss));
    const pair = miss.reason.startsWith('face_pair');
    // Jaws that cannot close on the part stand before it.
    const aside = pair ? this.before(miss) : 0;
    jaws.root.position.set(...miss.origin.map((v, n) => v - aside * miss.x1[n]));
    jaws.contacts.forEach((contact) => (contact.visible = false));
    const [gap, opened] = gapsOf(report, miss.width, miss.inside);
    const most = gripper?.stroke[1] ?? miss.width;
    const opening = pair ? most : miss.reason.startsWith('approach_blocked') ? opened : gap;
    const palm = pair ? { x: palmAlong(report, opening), z: 0, gap: opening } : { x: miss.palm[0], z: miss.palm[1], gap };
    jaws.place(opening, miss.inside ? -miss.width : miss.width, palm, palmAlong(report, palm.gap) - palmAlong(report, opening));
    this.target.visible = miss.place !== null;
    if (miss.place) {
      this.target.position.set(...miss.place);
      this.paint(miss);
    } else if (miss.reason.startsWith('scene:')) this.paintObstacle(miss.reason.slice('scene:'.length));
    this.measure(miss, pair ? opening : null, aside);
  }

  /** Paints the body that the reason names; of several of that name the one nearest to the place. */
  paint(miss) {
    const name = miss.reason.split(':')[1];
    const place = vector(miss.place).multiplyScalar(MM);
    this.jaws.root.updateMatrixWorld(true);
    let best = null;
    this.jaws.solid.traverse((body) => {
      if (body.userData.body?.replace(/\s/g, '_') !== name) return;
      const [, surface] = body.children;
      surface.geometry.computeBoundingBox();
      const local = surface.worldToLocal(place.clone());
      const box = surface.geometry.boundingBox;
      // Of bodies that both hold the place, the one whose middle is nearer.
      const away = box.distanceToPoint(local) + 1e-3 * box.getCenter(new Vector3()).distanceTo(local);
      if (!best || away < best.away) best = { away, surface };
    });
    if (!best) return;
    this.painted.push([best.surface, best.surface.material]);
    best.surface.material = this.hit;
  }

  /** How far before a pose the pads are clear of the part along the approach [m]. */
  before({ origin, x1 }) {
    const { part: { bbox_min: low, bbox_max: high }, gripper } = this.report.header;
    const deep = x1.reduce((sum, v, n) => sum + v * (origin[n] - (v > 0 ? low[n] : high[n])), 0);
    return deep + 1.2 * Math.max(...(gripper?.pad ?? [[0.01, 0]]).map(([x]) => x));
  }

  /** Paints the obstacle of the scene that stops a candidate. */
  paintObstacle(name) {
    const found = this.fixtures.children.find(({ userData }) => userData.obstacle?.replace(/\s/g, '_') === name);
    if (!found) return;
    const [surface] = found.children;
    this.painted.push([surface, surface.material]);
    surface.material = this.hit;
  }

  /** The width of a pair of faces as a line with ends, and that of the opened jaws `aside` before it; nothing without an opening. */
  measure(miss, opening, aside) {
    this.rule?.geometry.dispose();
    this.rule?.removeFromParent();
    if (opening === null) return;
    const { origin, x1, x3, width } = miss;
    const tick = 0.08 * Math.min(width, opening);
    const point = (along, across) => origin.map((v, k) => v + along * x3[k] + across * x1[k]);
    const bar = (reach, aside) => [[-reach, aside], [reach, aside], [-reach, aside - tick], [-reach, aside + tick], [reach, aside - tick], [reach, aside + tick]].flatMap(([a, b]) => point(a, b));
    const lines = new BufferGeometry().setAttribute('position', new Float32BufferAttribute([...bar(width / 2, 0), ...bar(opening / 2, -aside)], 3));
    this.rule = new LineSegments(lines, this.line);
    this.rule.renderOrder = 12;
    this.marks.add(this.rule);
  }

  /** What to frame so that the candidate shown is seen [mm]. */
  extent() {
    const { origin, x3, width, place } = this.report.miss(this.shown);
    const ends = [0.5, -0.5].map((side) => origin.map((v, k) => v + side * width * x3[k]));
    return [...ends, ...(place ? [place] : [])].map((point) => vector(point).multiplyScalar(MM));
  }
}
