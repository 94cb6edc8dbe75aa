// Shader calls within ifs, loops, a switch that falls through, nested loops, a loop's condition and functions, by an id
// that differs from lane to lane. Each stage defines `call`, which adds its operand to a total.

void call_twice(uint n) {
    call(n);
    call(n + 1u);
}

void flow(uint id) {
    if (id % 2u == 0u) {
        call(1u);
    } else {
        call(2u);
        call(3u);
    }
    for (uint i = 0u; i < id; ++i) {
        call(10u + i);
    }
    switch (id % 4u) {
    case 0u:
        call(100u);
        break;
    case 1u:
        call(200u);
    case 2u:
        call(300u);
        break;
    default:
        if (id > 4u) {
            call_twice(7u);
            return;
        }
        call(400u);
    }
    for (uint i = 0u; i < id; ++i) {
        for (uint j = 0u; j <= i; ++j) {
            if (j == 1u) {
                continue;
            }
            if (j == 4u) {
                break;
            }
            call(1000u * i + j);
        }
    }
    uint rounds = 0u;
    while (call_twice(5u), ++rounds < id) {
        call(50u);
    }
}
