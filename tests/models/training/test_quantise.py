"""The codebook: found where messages are, and nobody dead for long."""

import torch

from models.training.quantise import kmeans, revived


def clouds(generator):
    centres = torch.tensor([[0.0, 0.0], [5.0, 0.0], [0.0, 5.0]])
    return centres, (centres.repeat(40, 1) + 0.1 * torch.randn(120, 2, generator=generator))


def test_kmeans_finds_the_clouds():
    generator = torch.Generator().manual_seed(0)
    centres, vectors = clouds(generator)
    found = kmeans(vectors, 3, generator)
    assert torch.cdist(centres, found).min(1).values.max() < 0.2


def test_more_prototypes_than_different_vectors_are_no_trouble():
    found = kmeans(torch.ones(10, 2), 4, torch.Generator().manual_seed(0))
    assert torch.isfinite(found).all()


def test_an_unused_prototype_moves_to_a_vector_that_none_is_near():
    generator = torch.Generator().manual_seed(0)
    vectors = torch.tensor([[0.0, 0.0]] * 50 + [[9.0, 9.0]])
    codebook = torch.tensor([[0.0, 0.0], [-70.0, 3.0]])
    moved = revived(codebook, torch.tensor([50, 0]), vectors, generator)
    assert moved.tolist() == [[0.0, 0.0], [9.0, 9.0]]


def test_prototypes_in_use_stay():
    codebook = torch.randn(4, 2, generator=torch.Generator().manual_seed(1))
    assert torch.equal(revived(codebook, torch.ones(4), torch.zeros(3, 2), torch.Generator()), codebook)
