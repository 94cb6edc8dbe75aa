enable wgpu_ray_tracing_pipeline;

// Loops, switches, matrices and helper functions as naga lowers them.

@group(0) @binding(1) var<storage, read_write> outputs: array<vec4f>;

fn gcd(first: u32, second: u32) -> u32 {
    var a = first;
    var b = second;
    while b != 0u {
        let rest = a % b;
        a = b;
        b = rest;
    }
    return a;
}

fn classify(n: u32) -> i32 {
    switch n % 5u {
        case 0u, 1u: {
            return 10;
        }
        case 2u: {
            if n > 5u {
                break;
            }
            return 20;
        }
        default: {
            return 30;
        }
    }
    return -1;
}

fn triangular(n: u32) -> i32 {
    var sum = 0;
    var i = 0u;
    loop {
        if i > n {
            break;
        }
        if i == 7u {
            continue;
        }
        sum += i32(i);

        continuing {
            i += 1u;
            break if sum > 100;
        }
    }
    return sum;
}

@ray_generation
fn raygen(@builtin(ray_invocation_id) id: vec3u) {
    let n = id.x;
    let turn = mat2x2f(0.0, 1.0, -1.0, 0.0);
    let turned = turn * vec2f(f32(n), 1.0);
    outputs[2u * n] = vec4f(f32(gcd(n + 12u, 18u)), f32(classify(n)), f32(triangular(n)), turned.x);
    var table = array<f32, 4>(1.0, 2.0, 4.0, 8.0);
    table[n % 4u] += select(0.5, 0.25, n > 3u);
    outputs[2u * n + 1u] = vec4f(table[0], table[1], table[2], table[3]);
}
