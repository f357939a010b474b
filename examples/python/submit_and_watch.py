#!/usr/bin/env python3
"""Submits a campaign to a coordinator over TLS, and watches it until it stops.

In the folder of the repository, with a coordinator that listens with TLS at swarm.example:7700:

    pip install grpcio==1.85.1 grpcio-tools==1.85.1
    python -m grpc_tools.protoc -I proto --python_out=. --grpc_python_out=. proto/murmuration/v1/*.proto
    export PYTHONPATH=. MURMURATION_TOKEN_FILE=operator.token
    python examples/python/submit_and_watch.py swarm.example:7700 certs/ca.pem

docs/security.md shows how to make the certificates, the coordinator that uses them, and an operator's token. The script
prints a line for every change, then the campaign's id and the digest of its archive.
"""

import os
import sys
from pathlib import Path

import grpc
from murmuration.v1 import campaign_pb2 as messages
from murmuration.v1 import campaign_pb2_grpc as services


def connect(address: str, ca: str) -> grpc.Channel:
    """A channel that sends the token with every call, and trusts only a coordinator whose certificate `ca` signed."""
    token = Path(os.environ["MURMURATION_TOKEN_FILE"]).read_text().strip()
    tls = grpc.ssl_channel_credentials(Path(ca).read_bytes())
    return grpc.secure_channel(
        address, grpc.composite_channel_credentials(tls, grpc.access_token_call_credentials(token))
    )


def main() -> int:
    if len(sys.argv) != 3 or "MURMURATION_TOKEN_FILE" not in os.environ:
        print("usage: MURMURATION_TOKEN_FILE=FILE submit_and_watch.py HOST:PORT CA.pem", file=sys.stderr)
        return 2
    address, ca = sys.argv[1:]
    spec = messages.CampaignSpec(
        name="from-python",
        model="single-sensor",
        method=messages.METHOD_HAND_CRAFTED,
        world=messages.World(horizon=200),
        search=messages.Search(population=20, generations=5),
        taxonomy=messages.TaxonomyFormat(medoids=4),
    )
    with connect(address, ca) as channel:
        campaigns = services.CampaignServiceStub(channel)
        campaign = campaigns.CreateCampaign(messages.CreateCampaignRequest(spec=spec))
        for campaign in campaigns.WatchCampaign(messages.WatchCampaignRequest(campaign=campaign.id)):
            print(f"{campaign.generations_done} of {campaign.generations} generations", file=sys.stderr)
        if campaign.state != messages.CAMPAIGN_STATE_COMPLETED:
            print(f"campaign {campaign.id} stopped: {campaign.error}", file=sys.stderr)
            return 1
        digest = campaigns.GetDigest(messages.GetDigestRequest(campaign=campaign.id)).digest
        print(campaign.id, digest)
    return 0


if __name__ == "__main__":
    sys.exit(main())
