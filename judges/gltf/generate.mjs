// Generates glTF files with what the Khronos validator accepts and three.js makes of them: for each
// file the triangles in the world, at a time of its animation if it has one.
//
//     node generate.mjs FOLDER [COUNT [SEED]]
import fs from 'node:fs';
import path from 'node:path';
import validator from 'gltf-validator';

globalThis.self = globalThis;
globalThis.ProgressEvent = class {};
const THREE = await import('three');
const { GLTFLoader } = await import('three/examples/jsm/loaders/GLTFLoader.js');

const [BYTE, UNSIGNED_BYTE, SHORT, UNSIGNED_SHORT, UNSIGNED_INT, FLOAT] = [5120, 5121, 5122, 5123, 5125, 5126];
const VERTICES = 34962;
const INDICES = 34963;
const COMPONENTS = { SCALAR: 1, VEC3: 3, VEC4: 4, MAT4: 16 };
const TYPES = {
    [BYTE]: { size: 1, write: 'writeInt8', range: [-127, 127] },
    [UNSIGNED_BYTE]: { size: 1, write: 'writeUInt8', range: [0, 255] },
    [SHORT]: { size: 2, write: 'writeInt16LE', range: [-1000, 1000] },
    [UNSIGNED_SHORT]: { size: 2, write: 'writeUInt16LE', range: [0, 2000] },
    [UNSIGNED_INT]: { size: 4, write: 'writeUInt32LE', range: [0, 1000] },
    [FLOAT]: { size: 4, write: 'writeFloatLE' },
};

class Random {
    constructor(seed) {
        this.state = seed >>> 0;
    }
    unit() {
        this.state = (Math.imul(this.state, 1664525) + 1013904223) >>> 0;
        return this.state / 2 ** 32;
    }
    chance(probability) {
        return this.unit() < probability;
    }
    below(count) {
        return Math.floor(this.unit() * count);
    }
    pick(list) {
        return list[this.below(list.length)];
    }
    number() {
        return Math.fround(this.unit() * 4 - 2);
    }
    /// A number between 0 and 1.
    weight() {
        return Math.fround(this.unit());
    }
    list(count, value) {
        return Array.from({ length: count }, value);
    }
    vector() {
        return this.list(3, () => this.number());
    }
    quaternion() {
        const four = this.list(4, () => this.number());
        const length = Math.hypot(...four);
        return four.map(x => Math.fround(x / length));
    }
    matrix(scale) {
        const place = new THREE.Vector3(...this.vector());
        const turn = new THREE.Quaternion(...this.quaternion());
        return new THREE.Matrix4().compose(place, turn, new THREE.Vector3(...scale)).elements.map(Math.fround);
    }
}

/// A file while it is made.
class Model {
    constructor(random) {
        this.random = random;
        this.chunks = [];
        this.length = 0;
        this.time = null;
        this.document = {
            asset: { version: '2.0' }, scene: 0, scenes: [{ nodes: [] }],
            nodes: [], meshes: [], accessors: [], bufferViews: [],
        };
    }

    view(bytes, more) {
        const padding = (4 - (this.length % 4)) % 4;
        this.chunks.push(Buffer.alloc(padding), bytes);
        const byteOffset = this.length + padding;
        this.length = byteOffset + bytes.length;
        return this.document.bufferViews.push({ buffer: 0, byteOffset, byteLength: bytes.length, ...more }) - 1;
    }

    static bytes(values, type, components, stride) {
        const { size, write } = TYPES[type];
        const bytes = Buffer.alloc((values.length / components) * stride);
        values.forEach((value, at) => {
            bytes[write](value, Math.floor(at / components) * stride + (at % components) * size);
        });
        return bytes;
    }

    /// Adds an accessor. `vertex` aligns elements and may interleave them with gaps; `sparse` replaces
    /// some, perhaps of an accessor of zeros; `bounds` adds `min` and `max`.
    accessor(shape, type, values, { vertex = false, bounds = false, normalized = false, sparse = false } = {}) {
        const { random } = this;
        const components = COMPONENTS[shape];
        const count = values.length / components;
        const size = components * TYPES[type].size;
        const accessor = { componentType: type, count, type: shape };
        let stride = vertex ? Math.ceil(size / 4) * 4 : size;
        // three.js does not read sparse values over interleaved ones.
        if (vertex && !sparse) stride += random.pick([0, 0, 4, 8]);
        const final = values.slice();
        if (sparse && random.chance(0.5)) {
            final.fill(0);
        } else {
            const byteStride = vertex && (stride !== size || random.chance(0.5)) ? { byteStride: stride } : {};
            const target = vertex ? { target: VERTICES } : {};
            accessor.bufferView = this.view(Model.bytes(values, type, components, stride), { ...target, ...byteStride });
        }
        if (sparse) {
            const places = [...Array(count).keys()].filter(() => random.chance(0.5));
            if (places.length === 0) places.push(random.below(count));
            const own = places.flatMap(() => this.values(type, components));
            const indexType = random.pick([UNSIGNED_BYTE, UNSIGNED_SHORT, UNSIGNED_INT]);
            accessor.sparse = {
                count: places.length,
                indices: {
                    bufferView: this.view(Model.bytes(places, indexType, 1, TYPES[indexType].size)),
                    componentType: indexType,
                },
                values: { bufferView: this.view(Model.bytes(own, type, components, size)) },
            };
            places.forEach((place, at) => {
                final.splice(place * components, components, ...own.slice(at * components, (at + 1) * components));
            });
        }
        if (normalized) accessor.normalized = true;
        if (bounds) {
            const columns = [...Array(components).keys()].map(at => final.filter((_, k) => k % components === at));
            accessor.min = columns.map(column => Math.min(...column));
            accessor.max = columns.map(column => Math.max(...column));
        }
        return this.document.accessors.push(accessor) - 1;
    }

    values(type, count) {
        const { range } = TYPES[type];
        const one = () => (range ? range[0] + this.random.below(range[1] - range[0] + 1) : this.random.number());
        return this.random.list(count, one);
    }

    /// The state of a node. A scale of 0 flattens or hides it.
    transform(node, mayBeFlat) {
        const { random } = this;
        if (random.chance(0.3)) {
            node.matrix = random.matrix(random.list(3, () => 1 + random.unit()));
            return;
        }
        if (random.chance(0.7)) node.translation = random.vector();
        if (random.chance(0.7)) node.rotation = random.quaternion();
        if (random.chance(0.5)) node.scale = random.vector().map(x => x || 1);
        if (mayBeFlat && random.chance(0.15)) node.scale = random.pick([[0, 0, 0], [1, 2, 0], [0, 1, 1]]);
    }

    mesh(isSkinned, jointCount, isQuantized) {
        const { random } = this;
        const targetCount = random.chance(0.5) ? 1 + random.below(3) : 0;
        const primitives = random.list(1 + random.below(2), () => {
            const count = 3 + random.below(8);
            const type = isQuantized ? random.pick([BYTE, UNSIGNED_BYTE, SHORT, UNSIGNED_SHORT, FLOAT]) : FLOAT;
            const attributes = {
                POSITION: this.accessor('VEC3', type, this.values(type, 3 * count), {
                    vertex: true, bounds: true,
                    normalized: type !== FLOAT && random.chance(0.5),
                    sparse: type === FLOAT && random.chance(0.2),
                }),
            };
            if (isSkinned) Object.assign(attributes, this.influences(count, jointCount));
            let mode = random.pick([4, 4, 5, 6]);
            const primitive = { attributes };
            if (random.chance(0.6)) {
                const type = random.pick([UNSIGNED_BYTE, UNSIGNED_SHORT, UNSIGNED_INT]);
                const corners = mode === 4 ? 3 * (1 + random.below(4)) : 3 + random.below(6);
                primitive.indices = this.accessor('SCALAR', type, random.list(corners, () => random.below(count)));
                this.document.bufferViews[this.document.accessors[primitive.indices].bufferView].target = INDICES;
            } else if (count % 3) {
                mode = random.pick([5, 6]);
            }
            primitive.mode = mode;
            if (targetCount) {
                primitive.targets = random.list(targetCount, () => ({
                    POSITION: this.accessor('VEC3', FLOAT, this.values(FLOAT, 3 * count), {
                        vertex: true, bounds: true, sparse: random.chance(0.3),
                    }),
                }));
            }
            return primitive;
        });
        const mesh = { primitives };
        if (targetCount && random.chance(0.7)) mesh.weights = random.list(targetCount, () => random.weight());
        this.document.meshes.push(mesh);
    }

    /// The joints of vertices with weights whose sum is 1.
    influences(count, jointCount) {
        const { random } = this;
        const type = random.pick([FLOAT, UNSIGNED_BYTE, UNSIGNED_SHORT]);
        const most = { [UNSIGNED_BYTE]: 255, [UNSIGNED_SHORT]: 65535 }[type];
        const [joints, weights] = [[], []];
        for (let vertex = 0; vertex < count; vertex++) {
            const all = [...Array(jointCount).keys()];
            const own = random.list(1 + random.below(jointCount), () => all.splice(random.below(all.length), 1)[0]);
            let shares = own.map(() => 0.1 + random.unit());
            const sum = shares.reduce((x, y) => x + y);
            shares = shares.map(x => x / sum);
            if (most) {
                shares = shares.map(x => Math.floor(x * most));
                shares[0] += most - shares.reduce((x, y) => x + y);
            }
            while (own.length < 4) {
                own.push(0);
                shares.push(0);
            }
            joints.push(...own);
            weights.push(...shares);
        }
        const jointType = random.pick([UNSIGNED_BYTE, UNSIGNED_SHORT]);
        return {
            JOINTS_0: this.accessor('VEC4', jointType, joints, { vertex: true }),
            WEIGHTS_0: this.accessor('VEC4', type, weights, { vertex: true, normalized: type !== FLOAT }),
        };
    }

    targets(node) {
        return this.document.meshes[node.mesh]?.primitives[0].targets?.length ?? 0;
    }

    animation() {
        const { random, document } = this;
        const [channels, samplers, animated] = [[], [], new Set()];
        for (let tries = 0; tries < 3; tries++) {
            const at = random.below(document.nodes.length);
            const node = document.nodes[at];
            // three.js animates the weights of all nodes that share a mesh, or lie below the node.
            const isAlone = document.nodes.filter(other => other.mesh === node.mesh).length === 1 && !node.children;
            const targets = isAlone ? this.targets(node) : 0;
            const property = random.pick(['translation', 'rotation', 'scale', ...(targets ? ['weights', 'weights'] : [])]);
            if (node.matrix || animated.has(`${at} ${property}`)) continue;
            animated.add(`${at} ${property}`);
            const interpolation = random.pick(['LINEAR', 'STEP', 'CUBICSPLINE']);
            let last = 0.2;
            const times = random.list(2 + random.below(3), () => (last = Math.fround(last + 0.3 + random.unit())));
            const count = times.length * (interpolation === 'CUBICSPLINE' ? 3 : 1);
            const [shape, value] = {
                rotation: ['VEC4', () => random.quaternion()],
                weights: ['SCALAR', () => random.list(targets, () => random.weight())],
            }[property] ?? ['VEC3', () => random.vector()];
            const input = this.accessor('SCALAR', FLOAT, times, { bounds: true });
            const output = this.accessor(shape, FLOAT, random.list(count, value).flat());
            samplers.push({ input, output, interpolation });
            channels.push({ sampler: samplers.length - 1, target: { node: at, path: property } });
        }
        if (channels.length) {
            document.animations = [{ channels, samplers }];
            this.time = Math.fround(random.unit() * 4);
        }
    }

    static random(random) {
        const model = new Model(random);
        const { document } = model;
        const isQuantized = random.chance(0.4);
        if (isQuantized) {
            document.extensionsUsed = ['KHR_mesh_quantization'];
            document.extensionsRequired = ['KHR_mesh_quantization'];
        }
        const jointCount = 1 + random.below(4);
        const skinned = random.list(1 + random.below(3), () => random.chance(0.5));
        for (const isSkinned of skinned) model.mesh(isSkinned, jointCount, isQuantized);
        const add = (node, parents) => {
            const at = document.nodes.push({ ...node, name: `n${document.nodes.length}` }) - 1;
            const parent = parents.length ? document.nodes[random.pick(parents)] : undefined;
            if (parent) (parent.children ??= []).push(at);
            else document.scenes[0].nodes.push(at);
            return at;
        };
        const count = 3 + random.below(6);
        const nodes = [];
        while (nodes.length < count) {
            const node = {};
            // three.js divides by the transform of nodes with a skin.
            model.transform(node, !skinned.includes(true));
            if (random.chance(0.7)) {
                node.mesh = random.below(skinned.length);
                const targets = model.targets(node);
                const weight = () => (random.chance(0.3) ? 0 : random.weight());
                if (targets && random.chance(0.5)) node.weights = random.list(targets, weight);
                if (skinned[node.mesh]) node.skin = random.below(2);
            }
            nodes.push(add(node, random.chance(0.6) ? nodes : []));
        }
        const joints = [];
        while (joints.length < jointCount) {
            const node = {};
            model.transform(node, false);
            joints.push(add(node, joints));
        }
        if (document.nodes.some(node => node.skin !== undefined)) {
            document.skins = random.list(2, () => {
                const skin = { joints };
                if (random.chance(0.7)) {
                    const matrices = joints.flatMap(() => random.matrix([1, 1, 1]));
                    skin.inverseBindMatrices = model.accessor('MAT4', FLOAT, matrices);
                }
                return skin;
            });
        }
        if (random.chance(0.5)) model.animation();
        return model;
    }

    /// The extension and the bytes of the file: with a data URI, or binary.
    file() {
        const data = Buffer.concat(this.chunks);
        const buffer = { byteLength: data.length };
        this.document.buffers = [buffer];
        const kind = this.random.pick(['base64', 'percent', 'binary']);
        if (kind === 'base64') buffer.uri = `data:application/octet-stream;base64,${data.toString('base64')}`;
        if (kind === 'percent') buffer.uri = `data:application/gltf-buffer,${[...data].map(x => `%${x.toString(16).padStart(2, '0')}`).join('')}`;
        const json = Buffer.from(JSON.stringify(this.document));
        if (kind !== 'binary') return ['gltf', json];
        const chunk = (type, bytes, padding) => {
            const padded = Buffer.concat([bytes, Buffer.alloc((4 - (bytes.length % 4)) % 4, padding)]);
            const header = Buffer.from(`....${type}`, 'latin1');
            header.writeUInt32LE(padded.length);
            return Buffer.concat([header, padded]);
        };
        const body = Buffer.concat([chunk('JSON', json, ' '), chunk('BIN\0', data, 0)]);
        const header = Buffer.from('glTF........', 'latin1');
        header.writeUInt32LE(2, 4);
        header.writeUInt32LE(12 + body.length, 8);
        return ['glb', Buffer.concat([header, body])];
    }
}

/// The corners of all triangles in the world, as three.js reads a file.
async function triangles(bytes, time) {
    const content = bytes.buffer.slice(bytes.byteOffset, bytes.byteOffset + bytes.length);
    const { scene, animations } = await new Promise((done, fail) => new GLTFLoader().parse(content, '', done, fail));
    if (time !== null) {
        const mixer = new THREE.AnimationMixer(scene);
        const action = mixer.clipAction(animations[0]);
        action.setLoop(THREE.LoopOnce);
        action.clampWhenFinished = true;
        action.play();
        mixer.setTime(time);
    }
    scene.updateMatrixWorld(true);
    const corners = [];
    const corner = new THREE.Vector3();
    scene.traverse(object => {
        if (!object.isMesh) return;
        const linear = new THREE.Matrix3().setFromMatrix4(object.matrixWorld).elements;
        const isHidden = !object.isSkinnedMesh && linear.every(x => x === 0);
        if (isHidden) return;
        object.skeleton?.update();
        const { index, attributes } = object.geometry;
        const count = index ? index.count : attributes.position.count;
        for (let at = 0; at < count; at++) {
            object.getVertexPosition(index ? index.getX(at) : at, corner);
            corners.push(...corner.applyMatrix4(object.matrixWorld).toArray());
        }
    });
    return corners;
}

const [folder, count = 1000, seed = 1] = process.argv.slice(2);
fs.mkdirSync(folder, { recursive: true });
const random = new Random(Number(seed));
for (let at = 0; at < Number(count); at++) {
    const model = Model.random(random);
    const [extension, bytes] = model.file();
    const report = await validator.validateBytes(new Uint8Array(bytes));
    if (report.issues.numErrors) {
        const errors = report.issues.messages.filter(message => message.severity === 0);
        throw new Error(`model ${at} is invalid: ${JSON.stringify(errors.slice(0, 3))}`);
    }
    const expected = { time: model.time, corners: await triangles(bytes, model.time) };
    fs.writeFileSync(path.join(folder, `${at}.${extension}`), bytes);
    fs.writeFileSync(path.join(folder, `${at}.json`), JSON.stringify(expected));
}
console.log(`${count} models in ${folder}`);
