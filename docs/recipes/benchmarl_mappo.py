from benchmarl.algorithms import IppoConfig, MappoConfig
from benchmarl.experiment import Experiment, ExperimentConfig
from benchmarl.models.mlp import MlpConfig

from posse_training.benchmarl import PosseTask

task = PosseTask.SMART.get_from_yaml()
model = MlpConfig.get_from_yaml()
config = ExperimentConfig.get_from_yaml()
config.max_n_frames = 640
config.on_policy_collected_frames_per_batch = 640
config.on_policy_n_envs_per_worker = 8
config.on_policy_minibatch_size = 320
config.on_policy_n_minibatch_iters = 1
config.evaluation, config.loggers = False, []
for kind in (MappoConfig, IppoConfig):
    algorithm = kind.get_from_yaml()
    Experiment(task, algorithm, model, seed=0, config=config).run()
