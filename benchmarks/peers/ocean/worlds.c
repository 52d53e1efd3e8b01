/* Steps a number of PufferLib's Ocean `target` worlds on one core, in C from end to end. */
#include "target.h"

static Target *worlds;
static int count;

int build(int num_worlds, int num_agents, int num_goals) {
    const int size = 2 * (num_agents + num_goals) + 4;
    const long agents = (long)num_worlds * num_agents;
    float *observations = calloc(agents * size, sizeof(float));
    float *rewards = calloc(agents, sizeof(float));
    unsigned char *terminals = calloc(agents, 1);
    count = num_worlds;
    worlds = calloc(num_worlds, sizeof(Target));
    for (int e = 0; e < num_worlds; e++) {
        Target *world = &worlds[e];
        world->width = 1080;
        world->height = 720;
        world->num_agents = num_agents;
        world->num_goals = num_goals;
        world->observations = observations + (long)e * num_agents * size;
        world->rewards = rewards + (long)e * num_agents;
        world->terminals = terminals + (long)e * num_agents;
        init(world);
        c_reset(world);
    }
    return size;
}

/* actions: (sets, worlds, agents, 2), taken in turn. */
void run(int steps, int *actions, int sets) {
    const long agents = worlds[0].num_agents;
    for (int k = 0; k < steps; k++) {
        int *now = actions + (long)(k % sets) * count * agents * 2;
        for (int e = 0; e < count; e++) {
            worlds[e].actions = now + e * agents * 2;
            c_step(&worlds[e]);
        }
    }
}
