// What the stages of this case hand to each other.
struct Payload {
    uint seen;       // any-hit runs
    uint ignored;    // of which ignored
    int committed;   // primitive of the closest hit; -1 on a miss
    float t;
};
