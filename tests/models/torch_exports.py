"""Writes the ONNX files beside this script, as PyTorch 2.15 exports small networks, and their embeddings.

Usage: python3 tests/models/torch_exports.py (with torch, onnx and onnxscript)
"""

import json
import math
from pathlib import Path

import onnx
import torch
from torch import nn
from torch.nn import functional

FOLDER = Path(__file__).parent
PICTURES = 3


class View(nn.Module):
    """Rows of numbers by the size of the batch, as `x.view(x.size(0), -1)`."""

    def __init__(self) -> None:
        super().__init__()
        self.conv = nn.Conv2d(1, 4, 5, stride=3)
        self.dense = nn.Linear(4 * 8 * 8, 6)

    def forward(self, x: torch.Tensor) -> torch.Tensor:
        """The embeddings of pictures."""
        x = functional.max_pool2d(functional.relu6(self.conv(x / 255)), 2)
        return self.dense(x.view(x.size(0), -1))


class ChannelsLast(nn.Module):
    """A block of ConvNeXt."""

    def __init__(self) -> None:
        super().__init__()
        self.stem = nn.Conv2d(1, 8, 5, stride=5)
        self.depthwise = nn.Conv2d(8, 8, 3, padding=1, groups=8)
        self.norm = nn.LayerNorm(8)
        self.wide, self.narrow = nn.Linear(8, 16), nn.Linear(16, 8)
        self.head = nn.Linear(8, 5)

    def forward(self, x: torch.Tensor) -> torch.Tensor:
        """The embeddings of pictures."""
        x = self.stem(x / 255)
        y = self.norm(self.depthwise(x).permute(0, 2, 3, 1))
        x = x + self.narrow(functional.gelu(self.wide(y))).permute(0, 3, 1, 2)
        return functional.normalize(self.head(x.mean((2, 3))), dim=1)


class Attention(nn.Module):
    """A vision transformer with a class token."""

    def __init__(self) -> None:
        super().__init__()
        self.patches = nn.Conv2d(1, 8, 10, stride=10)
        self.token = nn.Parameter(torch.randn(1, 1, 8))
        self.places = nn.Parameter(torch.randn(1, 26, 8))
        self.qkv, self.out = nn.Linear(8, 24), nn.Linear(8, 8)
        self.norm = nn.LayerNorm(8)

    def forward(self, x: torch.Tensor) -> torch.Tensor:
        """The embeddings of pictures."""
        x = self.patches(x / 255).flatten(2).transpose(1, 2)
        x = torch.cat([self.token.expand(x.shape[0], -1, -1), x], dim=1) + self.places
        queries, keys, values = self.qkv(x).reshape(x.shape[0], 26, 3, 2, 4).permute(2, 0, 3, 1, 4).unbind(0)
        weights = (queries @ keys.transpose(-2, -1) / math.sqrt(4)).softmax(dim=-1)
        x = x + self.out((weights @ values).transpose(1, 2).reshape(x.shape[0], 26, 8))
        return self.norm(x)[:, 0]


class Colour(nn.Module):
    """Half precision inside, and larger pictures of three channels."""

    def __init__(self) -> None:
        super().__init__()
        self.conv = nn.Conv2d(3, 6, 7, stride=7).half()
        self.squeeze, self.excite = nn.Conv2d(6, 2, 1).half(), nn.Conv2d(2, 6, 1).half()

    def forward(self, x: torch.Tensor) -> torch.Tensor:
        """The embeddings of pictures."""
        x = functional.hardswish(self.conv(((x - 127) / 128).half()))
        x = x * functional.hardsigmoid(self.excite(functional.relu(self.squeeze(functional.adaptive_avg_pool2d(x, 1)))))
        return functional.adaptive_avg_pool2d(x, 2).flatten(1).float()


def pictures(channels: int, side: int) -> torch.Tensor:
    """Pictures that the test makes too: the pixel of index I in picture P is (7 I I + 31 P) mod 256."""
    count = channels * side * side
    pixels = [[(7 * i * i + 31 * p) % 256 for i in range(count)] for p in range(PICTURES)]
    return torch.tensor(pixels, dtype=torch.float32).reshape(PICTURES, channels, side, side)


def strip(file: Path) -> None:
    """Removes descriptions, which have the paths of this machine."""
    model = onnx.load(file, load_external_data=False)
    graph = model.graph
    for described in [model, graph, *graph.node, *graph.value_info, *graph.input, *graph.output, *graph.initializer]:
        del described.metadata_props[:]
        described.doc_string = ""
    onnx.save(model, file)


def main() -> None:
    """Writes all files."""
    embeddings = {}
    networks = [("view", View, 1, 50, True), ("channels-last", ChannelsLast, 1, 50, False)]
    networks += [("attention", Attention, 1, 50, True), ("colour", Colour, 3, 84, False)]
    for name, network, channels, side, is_new in networks:
        torch.manual_seed(1)
        model, images = network().eval(), pictures(channels, side)
        file = FOLDER / f"{name}.onnx"
        if is_new:
            shapes = ({0: torch.export.Dim("batch")},)
            torch.onnx.export(model, (images,), file, dynamo=True, dynamic_shapes=shapes, external_data=True)
        else:
            names = {"input_names": ["x"], "dynamic_axes": {"x": {0: "batch"}}}
            torch.onnx.export(model, (images,), file, dynamo=False, opset_version=17, **names)
        strip(file)
        embeddings[name] = model(images).detach().tolist()
    (FOLDER / "torch_exports.json").write_text(json.dumps(embeddings))


if __name__ == "__main__":
    main()
