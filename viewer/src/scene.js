// The part with the chosen grip in three dimensions. Draws only when something changed. The world is in millimetres.

import {
  AmbientLight, Box3, Box3Helper, BufferAttribute, BufferGeometry, CatmullRomCurve3, Color, DirectionalLight, DoubleSide, FrontSide, Group, HemisphereLight, LineBasicMaterial, LineSegments,
  Matrix4, Mesh, MeshBasicMaterial, MeshStandardMaterial, PerspectiveCamera, Points, PointsMaterial, Quaternion, Raycaster, Scene, Spherical, TubeGeometry, Vector2, Vector3,
  WebGLRenderer,
} from 'three';
import { OrbitControls } from 'three/examples/jsm/controls/OrbitControls.js';
import { friction } from './colour.js';
import { verdict } from './detail.js';
import { Jaws } from './jaws.js';
import { Misses } from './misses.js';
import { motionOf } from './motion.js';
import { approachSign, dotTexture, fixtures, frameSign, LoadSign, MotionSign } from './signs.js';
import { gaps, palmAlong, palmPlace } from './take.js';

const MM = 1000;
const MOVE_MS = 260;
const PLAY_MS = 2600;
/** Shares of it at which the approach ends and the jaws begin to close. */
const [ARRIVED, CLOSING] = [0.5, 0.55];
/** Places of a jaw at which its way is drawn. */
const STEPS = 24;
/** Radius of the part in the view [px] at which dots have their full size, and the least share of that. */
const [DOTTED, LEAST_DOT] = [260, 0.5];
/** Share of the view's width that what is framed fills, and the height [px] that it leaves free below the buttons. */
const [FILL, MARGIN] = [0.86, 16];
const UP = new Vector3(0, 0, 1);

const PALETTE = {
  light: { part: '#b4bdc8', edge: '#4b5663', jaw: '#4a6785', jawEdge: '#2f4a66', pad: '#d9762b', load: '#a3158f', fixture: '#8a6d00', ghost: '#0a7d6c', approach: '#0a5fb4', motion: '#18212b', sky: '#ffffff', ground: '#9aa3ad' },
  dark: { part: '#76828f', edge: '#11161b', jaw: '#9db4cc', jawEdge: '#c9d8e6', pad: '#f0964d', load: '#ef6bd8', fixture: '#d9b84a', ghost: '#4fd1bd', approach: '#6db3f8', motion: '#ffffff', sky: '#f2f6fa', ground: '#4a535d' },
};

const vector = (list) => new Vector3(...list);

export class View {
  /** Throws when the browser has no WebGL. */
  constructor(host, report, scale) {
    this.host = host;
    this.report = report;
    this.listeners = [];
    this.onPick = () => {};
    this.onMiss = () => {};
    this.grip = -1;
    this.open = false;
    this.renderer = new WebGLRenderer({ antialias: true, alpha: true });
    this.renderer.setPixelRatio(Math.min(window.devicePixelRatio || 1, 2));
    this.canvas = this.renderer.domElement;
    this.canvas.tabIndex = 0;
    this.canvas.setAttribute('role', 'application');
    this.canvas.setAttribute('aria-label', 'Part and gripper in three dimensions. Arrow keys turn, plus and minus zoom, shift with arrows moves, F shows all.');
    host.prepend(this.canvas);
    this.scene = new Scene();
    this.world = new Group();
    this.world.scale.setScalar(MM);
    this.scene.add(this.world);
    this.camera = new PerspectiveCamera(28, 1, 1, 1000);
    this.camera.up.copy(UP);
    this.lights();
    this.buildMaterials();
    this.buildPart();
    this.buildDots(scale);
    this.load = new LoadSign(this.materials.load);
    this.load.position.set(...report.header.part.mass.centre_of_mass);
    this.world.add(this.load);
    this.jaws = new Jaws(report.header.gripper, this.materials);
    this.world.add(this.jaws.root);
    this.buildSigns();
    this.gripperSize = 2 * MM * Math.max(0, ...this.jaws.corners().map((point) => point.length()));
    this.fixtures = fixtures(report, this.middle.clone().divideScalar(MM), this.radius / MM, this.materials);
    this.world.add(this.fixtures);
    this.misses = new Misses(report, this.jaws, this.fixtures);
    this.world.add(this.misses.group);
    this.controls = new OrbitControls(this.camera, this.canvas);
    this.controls.enableDamping = false;
    this.controls.zoomToCursor = true;
    this.controls.addEventListener('change', () => this.render());
    this.bindInput();
    this.world.updateMatrixWorld(true);
    new ResizeObserver(() => this.resize()).observe(host);
    this.resize();
    this.fit(0);
  }

  lights() {
    this.sky = new HemisphereLight(0xffffff, 0x888888, 1.5);
    this.sky.position.copy(UP);
    // A key light from over the viewer's left shoulder: edges of the part stay readable from every side.
    this.key = new DirectionalLight(0xffffff, 1.9);
    this.key.position.set(-0.6, 0.9, 1);
    this.camera.add(this.key, this.key.target, new AmbientLight(0xffffff, 0.35));
    this.key.target.position.set(0, 0, -1);
    this.scene.add(this.sky, this.camera);
  }

  buildMaterials() {
    const glass = { transparent: true, depthWrite: false, side: DoubleSide };
    const lift = { polygonOffset: true, polygonOffsetFactor: 1.5, polygonOffsetUnits: 1.5 };
    this.materials = {
      part: new MeshStandardMaterial({ roughness: 0.72, metalness: 0.08, side: DoubleSide, ...lift }),
      edge: new LineBasicMaterial({ transparent: true, opacity: 0.75 }),
      // The part and its contact areas stay visible through the one surface that is nearest.
      jawDepth: new MeshBasicMaterial({ colorWrite: false, transparent: true, ...lift }),
      jaw: new MeshStandardMaterial({ roughness: 0.55, metalness: 0.15, opacity: 0.42, ...glass, side: FrontSide }),
      jawEdge: new LineBasicMaterial({ transparent: true, opacity: 0.55 }),
      palm: new MeshStandardMaterial({ roughness: 0.55, metalness: 0.15, opacity: 0.34, ...glass, side: FrontSide }),
      approach: new MeshBasicMaterial({ depthTest: false, transparent: true }),
      pad: new MeshStandardMaterial({ roughness: 0.9, metalness: 0, opacity: 0.3, ...glass }),
      padEdge: new LineBasicMaterial(),
      contact: new MeshBasicMaterial({ transparent: true, opacity: 0.85, depthWrite: false, side: DoubleSide }),
      contactEdge: new LineBasicMaterial(),
      pressed: new MeshBasicMaterial({ vertexColors: true, side: DoubleSide, polygonOffset: true, polygonOffsetFactor: -3, polygonOffsetUnits: -3 }),
      load: new MeshBasicMaterial({ depthTest: false, transparent: true }),
      motion: new MeshBasicMaterial({ depthTest: false, transparent: true }),
      ghost: new LineBasicMaterial({ transparent: true, opacity: 0.9 }),
      fixture: new MeshBasicMaterial({ opacity: 0.14, ...glass }),
      fixtureEdge: new LineBasicMaterial({ transparent: true, opacity: 0.5 }),
    };
  }

  buildPart() {
    const { display, part } = this.report.header;
    const low = vector(part.bbox_min).multiplyScalar(MM);
    const high = vector(part.bbox_max).multiplyScalar(MM);
    this.box = new Box3(low, high);
    this.middle = this.box.getCenter(new Vector3());
    this.radius = Math.max(low.distanceTo(high) / 2, 1e-3);
    if (!display) {
      this.part = new Box3Helper(new Box3(vector(part.bbox_min), vector(part.bbox_max)));
      this.part.material = this.materials.edge;
      this.world.add(this.part);
      return;
    }
    const { positions, normals, triangles, edges } = this.report.column;
    const position = new BufferAttribute(positions, 3, true);
    const surface = new BufferGeometry();
    surface.setAttribute('position', position);
    // Four bytes per normal keep each vertex aligned; three.js reads the first three.
    surface.setAttribute('normal', new BufferAttribute(normals, 4, true));
    surface.setIndex(new BufferAttribute(triangles, 1));
    const lines = new BufferGeometry();
    lines.setAttribute('position', position);
    lines.setIndex(new BufferAttribute(edges, 1));
    this.part = new Group();
    this.partMesh = new Mesh(surface, this.materials.part);
    this.part.add(this.partMesh, new LineSegments(lines, this.materials.edge));
    this.part.position.set(...display.origin);
    this.part.scale.setScalar(display.scale);
    this.world.add(this.part);
  }

  /** Both pad centres of every grip, coloured by the friction needed: a disc where it holds, a cross where it slips. */
  buildDots(scale) {
    const { n, column } = this.report;
    this.scale = scale;
    const at = new Float32Array(6 * n);
    for (let i = 0; i < n; i++) {
      for (let side = 0; side < 2; side++) {
        const reach = (side ? -0.5 : 0.5) * column.width[i];
        for (let k = 0; k < 3; k++) {
          at[6 * i + 3 * side + k] = column.origin[3 * i + k] + reach * column.rotation[9 * i + 6 + k];
        }
      }
    }
    const geometry = new BufferGeometry();
    geometry.setAttribute('position', new BufferAttribute(at, 3));
    geometry.setAttribute('color', new BufferAttribute(new Uint8Array(6 * n), 3, true));
    const size = n < 400 ? 7 : n < 3000 ? 6 : 4.5;
    // Dots lie in the part's faces: a little towards the viewer, the faces no longer cut them.
    const lift = (0.025 * this.radius).toExponential(6);
    const raise = (shader) => {
      shader.vertexShader = shader.vertexShader.replace('#include <project_vertex>', `#include <project_vertex>\nmvPosition.xyz *= 1.0 - ${lift} / max(-mvPosition.z, ${lift});\ngl_Position = projectionMatrix * mvPosition;`);
    };
    this.dots = new Group();
    [this.holding, this.slipping] = [false, true].map((cross) => {
      const own = new BufferGeometry();
      own.setAttribute('position', geometry.attributes.position);
      own.setAttribute('color', geometry.attributes.color);
      own.setIndex(new BufferAttribute(new Uint32Array(2 * n), 1));
      const ownSize = cross ? size + 2 : size;
      const material = new PointsMaterial({ size: ownSize, sizeAttenuation: false, vertexColors: true, map: dotTexture(cross ? 'cross' : 'disc'), alphaTest: 0.35, transparent: true });
      material.onBeforeCompile = raise;
      const points = new Points(own, material);
      points.frustumCulled = false;
      points.userData.size = ownSize;
      this.dots.add(points);
      return points;
    });
    this.places = geometry.attributes.position;
    this.world.add(this.dots);
    this.recolour();
  }

  /** Colours the dots by the friction that is shown now. */
  recolour() {
    const colours = this.holding.geometry.attributes.color;
    // Vertex colours are taken as linear; the picture wants these very sRGB values.
    const linear = new Color();
    for (let i = 0; i < this.report.n; i++) {
      const [r, g, b] = friction(this.scale.at(this.report.mu(i)));
      linear.setRGB(r / 255, g / 255, b / 255, 'srgb');
      for (let side = 0; side < 2; side++) colours.array.set([linear.r * 255, linear.g * 255, linear.b * 255], 6 * i + 3 * side);
    }
    colours.needsUpdate = true;
  }

  setTheme(dark) {
    const colours = PALETTE[dark ? 'dark' : 'light'];
    for (const name of ['part', 'edge', 'jaw', 'jawEdge', 'pad', 'load', 'fixture', 'ghost', 'approach', 'motion']) this.materials[name].color.set(colours[name]);
    this.materials.palm.color.set(colours.jaw);
    this.materials.fixtureEdge.color.set(colours.fixture);
    for (const name of ['padEdge', 'contact', 'contactEdge']) this.materials[name].color.set(colours.pad);
    this.colours = colours;
    this.sky.color.set(colours.sky);
    this.sky.groundColor.set(colours.ground);
    this.render();
  }

  /** Shows these grips' dots, the best drawn last so that it stays on top. */
  setListed(indices) {
    const worstFirst = Uint32Array.from(indices).sort((a, b) => b - a);
    const slips = (i) => verdict(this.report, i)[1] === 'bad';
    for (const [points, cross] of [[this.holding, false], [this.slipping, true]]) {
      const { index } = points.geometry;
      let k = 0;
      for (const i of worstFirst) {
        if (slips(i) !== cross) continue;
        index.array[k++] = 2 * i;
        index.array[k++] = 2 * i + 1;
      }
      index.needsUpdate = true;
      points.geometry.setDrawRange(0, k);
    }
    this.listed = worstFirst;
    this.render();
  }

  /** Shows grip `i` (-1: none), gliding there from the last one. */
  setGrip(i, glide = true) {
    const known = this.grip >= 0;
    this.grip = i;
    this.load.visible = this.motionSign.visible = false;
    this.misses.show(-1);
    if (i < 0) return this.standAside();
    const { x1, x2, x3, origin } = this.report.pose(i);
    const to = { q: new Quaternion().setFromRotationMatrix(new Matrix4().makeBasis(vector(x1), vector(x2), vector(x3))), p: vector(origin) };
    this.jaws.setContact(this.report.contact(i), this.report.state(i));
    this.jaws.contacts.forEach((contact) => (contact.visible = true));
    this.width = this.report.column.width[i];
    this.inside = this.report.column.inside[i] === 1;
    this.drawWays();
    this.showMotion(this.report.state(i));
    this.glide(to, known && glide);
  }

  /** Draws load `load` at the centre of mass, and on faces that are not plane the pressure of `state` under it. */
  setLoad(load, state) {
    this.load.show(this.report.header.loads[load].wrench, this.radius / MM);
    if (state?.pieces && this.grip >= 0) this.jaws.setContact(this.report.contact(this.grip), state);
    this.showMotion(state);
    this.render();
  }

  /** Draws how the part would begin to slip with the pads in `state`. */
  showMotion(state) {
    if (this.grip < 0 || !state) return;
    const pad = this.report.header.gripper?.pad.map(([x, y]) => Math.hypot(x, y)) ?? [(0.3 * this.radius) / MM];
    this.motionSign.show(motionOf(this.report, this.grip, state.slip), 0.8 * Math.max(...pad));
  }

  /** The way of the front edge of either pad as the jaws close from where they are opened to. */
  drawWays() {
    const { gripper } = this.report.header;
    this.ways.visible = false;
    if (!gripper) return;
    const [holding, free] = gaps(this.report, this.grip);
    const [kept, front] = [this.opening, Math.max(...gripper.pad.map(([x]) => x))];
    const tracks = [[], []];
    for (let k = 0; k <= STEPS; k++) {
      this.opening = free + (k / STEPS) * (holding - free);
      this.placeJaws();
      this.jaws.fingers.forEach(({ position }, side) => tracks[side].push([position.x + front, position.y, position.z]));
    }
    this.opening = kept;
    this.ways.children.forEach((way, side) => {
      way.geometry.dispose();
      way.geometry = new TubeGeometry(new CatmullRomCurve3(tracks[side].map(vector)), STEPS, 0.02 * front, 8);
    });
  }

  /** Shows rejected candidate `k` in place of the grip (-1: the grip again). */
  setMiss(k) {
    cancelAnimationFrame(this.motion);
    this.moving = false;
    if (k < 0) return this.setGrip(this.grip, false);
    this.load.visible = this.motionSign.visible = this.ways.visible = false;
    this.misses.show(k);
    this.render();
  }

  /** Shows the outline of grip `i`'s gripper besides the chosen one (-1: none). */
  setPinned(i) {
    const { gripper } = this.report.header;
    if (i >= 0 && gripper && !this.ghost) {
      this.ghost = new Jaws(gripper, this.ghostMaterials());
      this.world.add(this.ghost.root);
    }
    if (this.ghost) {
      this.ghost.root.visible = i >= 0;
      if (i >= 0) {
        const { x1, x2, x3, origin } = this.report.pose(i);
        const width = this.report.column.width[i];
        const inside = this.report.column.inside[i] === 1;
        this.ghost.root.quaternion.setFromRotationMatrix(new Matrix4().makeBasis(vector(x1), vector(x2), vector(x3)));
        this.ghost.root.position.set(...origin);
        this.ghost.place(inside ? width - 2 * (gripper.outer_pad ?? 0) : width, inside ? -width : width, palmPlace(this.report, i));
      }
    }
    this.render();
  }

  ghostMaterials() {
    const unseen = new MeshBasicMaterial({ visible: false });
    const { ghost } = this.materials;
    return { jawDepth: unseen, jaw: unseen, palm: unseen, pad: unseen, contact: unseen, jawEdge: ghost, padEdge: ghost, contactEdge: ghost };
  }

  setOpen(open) {
    this.open = open;
    if (this.grip >= 0) this.glide({ q: this.jaws.root.quaternion.clone(), p: this.jaws.root.position.clone() }, true);
  }

  glide(to, smooth) {
    cancelAnimationFrame(this.motion);
    const root = this.jaws.root;
    const from = { q: root.quaternion.clone(), p: root.position.clone(), opening: this.opening ?? this.width };
    // From inside, the fingers' outer faces touch, and the jaws let go by closing.
    const [holding, free] = gaps(this.report, this.grip);
    const opening = this.open ? free : holding;
    this.ways.visible = this.open;
    const step = (t) => {
      root.quaternion.slerpQuaternions(from.q, to.q, t);
      root.position.lerpVectors(from.p, to.p, t);
      this.opening = from.opening + t * (opening - from.opening);
      this.placeJaws();
      this.render();
    };
    this.moving = false;
    if (!smooth || window.matchMedia('(prefers-reduced-motion: reduce)').matches) return step(1);
    this.moving = true;
    const start = performance.now();
    const frame = (now) => {
      const t = Math.min(1, Math.max(0, (now - start) / MOVE_MS));
      step(t * t * (3 - 2 * t));
      this.moving = t < 1;
      if (this.moving) this.motion = requestAnimationFrame(frame);
    };
    this.motion = requestAnimationFrame(frame);
  }

  /** Opens the jaws of the grip shown, along their arc; the palm stays where it is in the grip. */
  placeJaws() {
    const palm = palmPlace(this.report, this.grip);
    const ahead = palmAlong(this.report, palm.gap) - palmAlong(this.report, this.opening);
    this.jaws.place(this.opening, this.inside ? -this.width : this.width, palm, ahead);
  }

  /** The way in and the closing of the jaws, as planned; ends in the grip. */
  play() {
    if (this.grip < 0) return;
    cancelAnimationFrame(this.motion);
    const { root } = this.jaws;
    const { x1, origin } = this.report.pose(this.grip);
    const [holding, free] = gaps(this.report, this.grip);
    const away = Math.max((1.1 * this.radius) / MM, 0.04);
    const ease = (t) => t * t * (3 - 2 * t);
    const step = (t) => {
      const way = ease(Math.min(t / ARRIVED, 1)) - 1;
      root.position.set(...origin).addScaledVector(vector(x1), way * away);
      this.opening = free + ease(Math.max((t - CLOSING) / (1 - CLOSING), 0)) * (holding - free);
      this.placeJaws();
      this.ways.visible = t >= ARRIVED;
      this.jaws.contacts.forEach((contact) => (contact.visible = t >= 1));
      this.motionSign.visible = t >= 1 && this.motionSign.drawn;
      this.draw();
    };
    this.moving = true;
    const start = performance.now();
    // Asked for by hand, so it is shown even to those who want little motion, but in four still pictures.
    const still = window.matchMedia('(prefers-reduced-motion: reduce)').matches;
    const frame = (now) => {
      const t = Math.min(1, Math.max(0, (now - start) / PLAY_MS));
      step(still ? Math.floor(t * 4) / 4 : t);
      this.moving = t < 1;
      if (this.moving) this.motion = requestAnimationFrame(frame);
      else this.setOpen(this.open);
    };
    this.motion = requestAnimationFrame(frame);
  }

  /** Draws at another size [px] and hands the canvas to `take` before all is as it was. */
  paint(width, height, take) {
    const ratio = this.renderer.getPixelRatio();
    this.renderer.setPixelRatio(1);
    this.renderer.setSize(width, height, false);
    this.camera.aspect = width / height;
    this.draw();
    take(this.canvas);
    this.renderer.setPixelRatio(ratio);
    this.resize();
  }

  show(what, visible) {
    if (what === 'gripper') this.jaws.solid.visible = this.approach.visible = visible;
    if (what === 'dots') this.dots.visible = visible;
    if (what === 'misses') {
      this.misses.points.visible = visible;
      if (!visible && this.misses.shown >= 0 && this.grip >= 0) this.onMiss(-1);
    }
    if (what === 'motion') this.jaws.root[visible ? 'add' : 'remove'](this.motionSign);
    if (what === 'load') this.world[visible ? 'add' : 'remove'](this.load);
    if (what === 'glass' && this.partMesh) {
      const material = this.materials.part;
      material.transparent = visible;
      material.opacity = visible ? 0.3 : 1;
      material.depthWrite = !visible;
      material.needsUpdate = true;
    }
    this.render();
  }

  /** Without a grip the gripper stands above the part, to scale, its jaws at their widest. */
  standAside() {
    const { gripper } = this.report.header;
    this.jaws.root.visible = Boolean(gripper);
    if (gripper) {
      this.jaws.root.quaternion.identity();
      this.jaws.root.position.set(0, 0, 0);
      const reach = Math.max(...this.jaws.corners().map((point) => point.x));
      const size = this.box.getSize(new Vector3());
      const away = 1.4 * reach;
      // Approach downwards, closing along the part's shorter side.
      const closing = size.x < size.y ? new Vector3(1, 0, 0) : new Vector3(0, 1, 0);
      const approach = new Vector3(0, 0, -1);
      this.jaws.root.quaternion.setFromRotationMatrix(new Matrix4().makeBasis(approach, closing.clone().cross(approach), closing));
      this.jaws.root.position.set(this.middle.x / MM, this.middle.y / MM, this.box.max.z / MM + away);
      this.jaws.place(gripper.stroke[1], gripper.stroke[1]);
    }
    this.render();
  }

  /** An arrow along the approach, and the flange frame where the gripper states one. */
  buildSigns() {
    const { gripper } = this.report.header;
    const pad = gripper ? Math.max(...gripper.pad.map((point) => point[0])) : 0;
    this.approach = approachSign(this.materials.approach, Math.max((0.5 * this.radius) / MM, 2 * pad), pad);
    this.motionSign = new MotionSign(this.materials.motion);
    this.motionSign.visible = false;
    this.ways = new Group().add(...[0, 1].map(() => new Mesh(new BufferGeometry(), this.materials.approach)));
    this.ways.visible = false;
    this.ways.children.forEach((way) => (way.renderOrder = 9));
    this.jaws.root.add(this.approach, this.motionSign, this.ways);
    if (!gripper?.flange) return;
    this.flange = frameSign(gripper.flange, 0.022 / MM);
    this.jaws.palm.add(this.flange);
  }

  /** The whole part from a side on which grip `i`'s jaws are seen: across the closing axis, a little from its palm. */
  fit(i = this.grip, withGripper = i < 0) {
    let towards = new Vector3(1, -1.35, 0.85);
    const pose = this.misses.shown >= 0 ? this.report.miss(this.misses.shown) : i >= 0 && i < this.report.n ? this.report.pose(i) : null;
    if (pose) {
      const { x1, x2, x3 } = pose;
      const looks = [1, -1].flatMap((x) => [1, -1].flatMap((y) => [0.85, 0.5, -0.5].map((z) => new Vector3(x, 1.35 * y, z).normalize())));
      const worth = (look) => Math.abs(look.dot(vector(x2))) - 0.35 * look.dot(vector(x1)) + 0.25 * Math.abs(look.dot(vector(x3))) + (look.z > 0 ? 0.5 : 0) - (look.y > 0 ? 0.08 : 0);
      towards = looks.sort((a, b) => worth(b) - worth(a))[0];
    }
    const { min, max } = this.box;
    const corners = [min.x, max.x].flatMap((x) => [min.y, max.y].flatMap((y) => [min.z, max.z].map((z) => new Vector3(x, y, z))));
    if (withGripper && this.jaws.root.visible) corners.push(...this.jaws.corners().map((point) => point.multiplyScalar(MM)));
    this.frame(corners, towards);
  }

  /** The chosen grip from close by. */
  lookAtGrip() {
    if (this.misses.shown >= 0) return this.frame(this.around(this.misses.extent()), this.camera.position.clone().sub(this.controls.target));
    if (this.grip < 0) return this.fit();
    const { x1, x2, x3, origin } = this.report.pose(this.grip);
    const place = new Matrix4().makeBasis(vector(x1), vector(x2), vector(x3)).setPosition(...origin);
    const outline = this.report.header.gripper?.pad ?? this.report.contact(this.grip).flatMap((ring) => ring.points);
    const points = outline.flatMap(([x, y]) => [0.5, -0.5].map((side) => new Vector3(x, y, side * this.width).applyMatrix4(place).multiplyScalar(MM)));
    this.frame(points, this.camera.position.clone().sub(this.controls.target));
  }

  /** Points [mm] with room of a pad's size about them. */
  around(points) {
    const room = 2 * MM * Math.max(...(this.report.header.gripper?.pad ?? [[0.005, 0]]).map(([x, y]) => Math.hypot(x, y)));
    return points.flatMap((point) => [-room, room].flatMap((r) => [0, 1, 2].map((k) => point.clone().setComponent(k, point.getComponent(k) + r))));
  }

  /** Moves the camera to the side `towards` and so near that `points` [mm] just fill the part of the view that is free. */
  frame(points, towards) {
    const out = towards.clone().normalize();
    const right = UP.clone().cross(out);
    if (right.lengthSq() < 1e-9) right.set(1, 0, 0);
    right.normalize();
    const up = out.clone().cross(right);
    const tall = Math.tan((this.camera.fov * Math.PI) / 360);
    // Above lie the buttons; below, as much is left for the note.
    const bar = this.host.querySelector('#toolbar')?.offsetHeight ?? 0;
    const free = Math.max(0.5, 1 - (2 * (bar + MARGIN)) / Math.max(this.host.clientHeight, 1));
    const half = [FILL * tall * this.camera.aspect, free * tall];
    // The perspective makes the nearer points larger: the middle is looked for by steps.
    const centre = new Box3().setFromPoints(points).getCenter(new Vector3());
    let distance = 0;
    for (let step = 0; step < 8; step++) {
      const seen = points.map((point) => point.clone().sub(centre)).map((point) => [point.dot(right), point.dot(up), point.dot(out)]);
      distance = Math.max(...seen.map(([x, y, z]) => z + Math.max(Math.abs(x) / half[0], Math.abs(y) / half[1])), 1e-3);
      for (const [k, axis] of [right, up].entries()) {
        const places = seen.map((point) => point[k] / (distance - point[2]));
        centre.addScaledVector(axis, ((Math.min(...places) + Math.max(...places)) / 2) * distance);
      }
    }
    this.controls.target.copy(centre);
    this.camera.position.copy(centre).addScaledVector(out, distance);
    this.controls.update();
    this.render();
  }

  /** Turns the camera about its target by angles [rad]. */
  orbit(sideways, upwards) {
    const offset = this.camera.position.clone().sub(this.controls.target);
    // three.js measures spherical angles from y; the part's up is z.
    const spherical = new Spherical().setFromVector3(new Vector3(offset.x, offset.z, -offset.y));
    spherical.theta += sideways;
    spherical.phi = Math.min(Math.max(spherical.phi + upwards, 0.02), Math.PI - 0.02);
    const turned = new Vector3().setFromSpherical(spherical);
    this.camera.position.copy(this.controls.target).add(new Vector3(turned.x, -turned.z, turned.y));
    this.controls.update();
    this.render();
  }

  /** Looks against the direction `d` of the part frame, so that a load along `d` points at the viewer. */
  faceDirection(d) {
    const distance = this.camera.position.distanceTo(this.controls.target);
    const tilted = vector(d).normalize().add(new Vector3(0.18, -0.22, 0.2)).normalize();
    this.camera.position.copy(this.controls.target).addScaledVector(tilted, distance);
    this.controls.update();
    this.render();
  }

  zoom(factor) {
    this.camera.position.sub(this.controls.target).multiplyScalar(factor).add(this.controls.target);
    this.controls.update();
    this.render();
  }

  bindInput() {
    this.canvas.addEventListener('keydown', (event) => {
      if (event.altKey || event.ctrlKey || event.metaKey) return;
      const arrow = { ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, -1], ArrowDown: [0, 1] }[event.key];
      if (arrow && event.shiftKey) {
        const step = this.camera.position.distanceTo(this.controls.target) * 0.03;
        const move = new Vector3(arrow[0] * step, -arrow[1] * step, 0).applyQuaternion(this.camera.quaternion);
        this.camera.position.sub(move);
        this.controls.target.sub(move);
        this.controls.update();
        this.render();
      } else if (arrow) this.orbit(arrow[0] * 0.12, arrow[1] * 0.12);
      else if (event.key === '+' || event.key === '=') this.zoom(1 / 1.15);
      else if (event.key === '-') this.zoom(1.15);
      else if (event.key === 'f' || event.key === 'F') this.fit();
      else if (event.key === 'a' || event.key === 'A') this.fit(this.grip, true);
      else if (event.key === 'p' || event.key === 'P') this.play();
      else if (event.key === 'g' || event.key === 'G') this.lookAtGrip();
      else return;
      event.preventDefault();
    });
    let down = null;
    this.canvas.addEventListener('pointerdown', (event) => (down = [event.clientX, event.clientY]));
    this.canvas.addEventListener('pointerup', (event) => {
      if (down && Math.hypot(event.clientX - down[0], event.clientY - down[1]) < 5) this.pick(event);
      down = null;
    });
  }

  /** The listed grip, or the rejected candidate, whose dot is under the pointer and not hidden by the part. */
  pick(event) {
    const rect = this.canvas.getBoundingClientRect();
    const at = [event.clientX - rect.left, event.clientY - rect.top];
    const point = new Vector3();
    const hits = [];
    const look = (places, index, found) => {
      point.fromBufferAttribute(places, index).multiplyScalar(MM);
      const depth = point.distanceTo(this.camera.position);
      point.project(this.camera);
      const away = Math.hypot(((point.x + 1) / 2) * rect.width - at[0], ((1 - point.y) / 2) * rect.height - at[1]);
      if (away < 9) hits.push({ ...found, depth, away });
    };
    if (this.dots.visible) for (const i of this.listed ?? []) for (let side = 0; side < 2; side++) look(this.places, 2 * i + side, { i });
    if (this.misses.points.visible) this.misses.of.forEach((miss, index) => look(this.misses.points.geometry.attributes.position, index, { i: Infinity, miss }));
    if (hits.length === 0) return;
    const caster = new Raycaster();
    caster.setFromCamera(new Vector2((at[0] / rect.width) * 2 - 1, 1 - (at[1] / rect.height) * 2), this.camera);
    const wall = (this.partMesh ? caster.intersectObject(this.partMesh)[0]?.distance : null) ?? Infinity;
    const seen = hits.filter((hit) => hit.depth < wall + 0.02 * this.radius);
    // Grips of many angles share one place: the best of the nearest dots is meant.
    const nearest = Math.min(...seen.map((hit) => hit.away));
    const best = seen.filter((hit) => hit.away < nearest + 1.5).sort((a, b) => a.i - b.i)[0];
    if (best) best.miss === undefined ? this.onPick(best.i) : this.onMiss(best.miss);
  }

  resize() {
    const { clientWidth: width, clientHeight: height } = this.host;
    if (width === 0 || height === 0) return;
    this.renderer.setSize(width, height);
    this.camera.aspect = width / height;
    this.camera.updateProjectionMatrix();
    this.draw();
  }

  render() {
    this.pending ??= requestAnimationFrame(() => this.draw());
  }

  draw() {
    if (this.pending) cancelAnimationFrame(this.pending);
    this.pending = undefined;
    const distance = this.camera.position.distanceTo(this.middle);
    const reach = this.radius * 8 + this.gripperSize;
    this.camera.near = Math.max(distance - reach, distance * 0.01, this.radius * 0.002);
    this.camera.far = distance + reach;
    this.camera.updateProjectionMatrix();
    // Seen from afar, dots of one size would cover the part.
    const seen = (this.radius / (distance * Math.tan((this.camera.fov * Math.PI) / 360))) * (this.host.clientHeight / 2);
    const share = Math.min(1, Math.max(LEAST_DOT, seen / DOTTED));
    for (const { material, userData } of this.dots.children) material.size = share * userData.size;
    this.renderer.render(this.scene, this.camera);
    this.listeners.forEach((listener) => listener());
  }

  /** Rows of the rotation that takes part directions to the picture: right, up, towards the viewer. */
  axes() {
    const e = this.camera.matrixWorld.elements;
    return [[e[0], e[1], e[2]], [e[4], e[5], e[6]], [e[8], e[9], e[10]]];
  }
}
