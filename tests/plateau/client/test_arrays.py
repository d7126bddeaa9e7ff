"""The client fetches images, slices and curves as numpy arrays."""

import csv
import io

import numpy as np
import pytest
import redis

from plateau import ApiError, Client
from plateau.farm.blobs.store import Blobs
from plateau.farm.images.exr import encode_layers, encode_partial
from tests.support.farms.staged_job import HEIGHT, WIDTH, StagedJob
from tests.support.images.plain_exr import encode_image, partial_of


def test_the_merged_image_is_an_array(plateau: Client, client: redis.Redis, store: Blobs) -> None:
    job = StagedJob(client)
    with pytest.raises(ApiError) as caught:
        plateau.array(job.id)
    assert caught.value.slug == "no-image-yet"
    job.commit(4)
    radiance = np.random.default_rng(1).random((HEIGHT, WIDTH, 3), dtype=np.float32) * 10
    job.picture(store, "image.exr", encode_image(radiance))
    fetched = plateau.array(job.id)
    assert (fetched.shape, fetched.dtype) == ((HEIGHT, WIDTH, 3), np.float32)
    assert np.array_equal(fetched, radiance)


def test_the_channels_of_the_image_are_arrays_by_name(
    plateau: Client, client: redis.Redis, store: Blobs
) -> None:
    job = StagedJob(client)
    planes = {
        name: np.full((3, 2), value, np.float32)
        for value, name in enumerate(("R", "G", "B", "A", "albedo.R", "Z", "id.shape"))
    }
    content = encode_layers(planes, {}, precision="half", whole=("Z", "id.shape"))
    job.picture(store, "image.exr", content)
    channels = plateau.channels(job.id)
    assert channels.keys() == planes.keys()
    for name, plane in channels.items():
        assert plane.dtype == np.float32
        assert np.array_equal(plane, planes[name])


def test_a_slice_is_its_film(plateau: Client, client: redis.Redis, store: Blobs) -> None:
    job = StagedJob(client, keep_slices=True)
    with pytest.raises(ApiError) as caught:
        plateau.film(job.id, 0)
    assert caught.value.slug == "unknown-slice"
    film = np.random.default_rng(2).random((HEIGHT, WIDTH, 4), dtype=np.float32)
    partial = encode_partial(partial_of(film, job_id=job.id, last_seed=9, spp=25))
    store.put(job.slice_blob(0), partial)
    job.commit(partial=partial)
    fetched = plateau.film(job.id, 0)
    assert fetched.dtype == np.float32
    assert np.array_equal(fetched, film)


def test_a_curve_is_columns_called_as_in_its_csv(plateau: Client, client: redis.Redis) -> None:
    job = StagedJob(client)
    empty = plateau.curve_columns(job.id)
    assert {len(column) for column in empty.values()} == {0}
    job.commit(8)
    job.point(100, 7)
    job.point(200, 9, slope=0.02)
    columns = plateau.curve_columns(job.id)
    rows = list(csv.DictReader(io.StringIO(plateau.curve_csv(job.id))))
    assert set(columns) == set(rows[0])
    assert columns["spp"].dtype == columns["visible_pixels"].dtype == np.int64
    assert columns["spp"].tolist() == [100, 200]
    assert columns["visible_pixels"].tolist() == [7, 9]
    assert np.array_equal(columns["slope"], [np.nan, 0.02], equal_nan=True)
    assert np.array_equal(columns["reverse_value"], [np.nan, 0.02], equal_nan=True)
    assert np.isnan(columns["expected_spp"]).all()
    assert (columns["reverse_stop"].dtype, columns["at"].dtype.kind) == (np.bool_, "M")
    for name, column in columns.items():
        if column.dtype == np.float64:
            said = [float(row[name]) if row[name] else np.nan for row in rows]
            assert np.array_equal(column, said, equal_nan=True), name
