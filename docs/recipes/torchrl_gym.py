from torchrl.envs import GymEnv

one = GymEnv("posse:posse/Solo-v0", scenario="smart")
print(one.rollout(20)["observation"].shape)
if __name__ == "__main__":  # it starts processes
    many = GymEnv("posse:posse/Team-v0", num_workers=2)
    print(many.rollout(20)["observation"].shape)
    many.close()
