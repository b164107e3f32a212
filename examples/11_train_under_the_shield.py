"""Train a policy that reaches for goals among people, save and load it, and run it under the shield.

    make learn
    .venv/bin/python -m pip install stable-baselines3
    .venv/bin/python examples/11_train_under_the_shield.py --steps 200000

With `--alone` only joint limits are between policy and arm, in training and afterwards.
"""

import argparse

import gymnasium

from pretouch_lab.learning import REACH

try:
    from stable_baselines3 import PPO
except ImportError:
    raise SystemExit("This example needs stable-baselines3: run python -m pip install stable-baselines3") from None

parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
parser.add_argument("--steps", type=int, default=200_000, help="training steps, each 0.05 s of simulated time")
parser.add_argument("--episodes", type=int, default=3, help="episodes to run with the trained policy")
parser.add_argument("--file", default="policy.zip")
parser.add_argument("--alone", action="store_true", help="no shield")
options = parser.parse_args()

env = gymnasium.make(REACH, shield=not options.alone)
model = PPO("MultiInputPolicy", env, n_steps=min(1024, options.steps), seed=0, device="cpu")
model.learn(options.steps)
model.save(options.file)
print(f"Trained for {options.steps} steps: {options.file}")

policy = PPO.load(options.file, device="cpu")
for seed in range(options.episodes):
    observation, info = env.reset(seed=seed)
    earned, over = 0.0, False
    while not over:
        action, _ = policy.predict(observation, deterministic=True)
        observation, reward, terminated, truncated, info = env.step(action)
        earned, over = earned + reward, terminated or truncated
    print(f"Trial {seed}: {earned:.1f}, {info['goals']} goals, peak force {info['peak_force_n']:.0f} N")
