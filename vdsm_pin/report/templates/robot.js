// Any robot: its links as solids, each where the page was told that it is.
"use strict";

// The motion of a robot: middles of its links and their turns at moments.
class LinkMotion extends Motion {
  read(data) {
    this.onPath = []; // there is no desired path
    this.drawn = { moments: unpack(data.moments, Float64Array) };
    this.count = data.links;
    this.places = unpack(data.places, Float32Array); // link by link, moment by moment
    this.turns = unpack(data.turns, Float32Array);
  }

  // The middles of the links, and their turns as quaternions x, y, z, w.
  poses(time) {
    const { moments } = this.drawn;
    const [k, share] = between(moments, time);
    const next = Math.min(k + 1, moments.length - 1);
    const points = [];
    const turns = [];
    for (let link = 0; link < this.count; link++) {
      const [a, b] = [k, next].map((moment) => link * moments.length + moment);
      const mix = (values, size, sign) =>
        Array.from({ length: size }, (_, i) =>
          values[size * a + i] * (1 - share) + sign * values[size * b + i] * share);
      const same = [0, 1, 2, 3].reduce(
        (sum, i) => sum + this.turns[4 * a + i] * this.turns[4 * b + i], 0);
      const turn = mix(this.turns, 4, same < 0 ? -1 : 1);
      points.push(mix(this.places, 3, 1));
      turns.push(turn.map((value) => value / Math.hypot(...turn)));
    }
    return [points, turns];
  }
}

class Robot {
  // `scene` is the page's; `more` changes the look of every link, of a ghost for example.
  constructor(scene, more = {}) {
    const { Mesh, Group, EdgesGeometry, LineSegments, LineBasicMaterial, DoubleSide } =
      MeshCat.THREE;
    this.colours = scene.colours;
    this.group = new Group();
    this.links = scene.links.map((solid, k) => {
      const [shape, indexed] = solidShape(solid);
      const look = { side: DoubleSide, ...more };
      const link = new Mesh(shape, phong(scene.colours[k], look));
      const ink = new LineBasicMaterial({ color: 0x3b4048, transparent: true, opacity: 0.35 });
      if (!solid.round) link.add(new LineSegments(new EdgesGeometry(indexed, CREASE), ink));
      link.name = solid.name;
      link.looks = (solid.looks || []).map((one) => {
        const skin = new Mesh(solidShape(one)[0], phong(one.colour, { side: DoubleSide, ...more }));
        skin.own = one.colour;
        link.add(skin);
        return skin;
      });
      return link;
    });
    this.showSolids(false);
    for (const link of this.links) this.group.add(link);
  }

  // Put the links where their middles and turns are.
  pose(centres, turns) {
    this.links.forEach((link, k) => {
      link.position.set(...centres[k]);
      link.quaternion.set(...turns[k]);
    });
  }

  // Give some links, counted from 0, another colour.
  mark(links, colour) {
    this.links.forEach((one, i) => {
      one.material.color.set(links.includes(i) ? colour : this.colours[i]);
      for (const skin of one.looks)
        skin.material.color.set(links.includes(i) ? colour : skin.own);
    });
  }

  // Show what was proved around what the links look like, or that alone.
  showSolids(on) {
    for (const link of this.links.filter((one) => one.looks.length)) {
      const glass = { transparent: true, opacity: 0.35, depthWrite: false };
      link.material.setValues(glass);
      link.material.visible = on;
      for (const part of link.children) if (!link.looks.includes(part)) part.visible = on;
    }
  }

  // Corners of the boxes around the links where they stand.
  reach() {
    return this.links.flatMap((link) => {
      link.updateMatrix();
      if (!link.geometry.boundingBox) link.geometry.computeBoundingBox();
      return boxCorners(link.geometry.boundingBox).map((p) => p.applyMatrix4(link.matrix));
    });
  }

  hideEnd() {} // no view is from its tip

  // The links at many moments at once.
  swept(motion, moments) {
    const { InstancedMesh, Group } = MeshCat.THREE;
    const glass = { transparent: true, opacity: 0.1, depthWrite: false };
    const group = new Group();
    const bodies = this.links.map((link, k) => {
      const body = new InstancedMesh(link.geometry, phong(this.colours[k], glass), moments);
      body.frustumCulled = false;
      group.add(body);
      return body;
    });
    const stand = new Robot({ colours: this.colours, links: [] });
    stand.links = bodies.map(() => new MeshCat.THREE.Object3D());
    for (let m = 0; m < moments; m++) {
      stand.pose(...motion.poses(motion.momentAt(m / Math.max(1, moments - 1))));
      stand.links.forEach((link, k) => {
        link.updateMatrix();
        bodies[k].setMatrixAt(m, link.matrix);
      });
    }
    return group;
  }
}
