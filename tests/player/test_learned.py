"""What a passage taught, kept and taken up again."""

from gramoscope.pickup.texture.layout import StripeLayout
from gramoscope.pickup.texture_likelihood import TextureLikelihood, TexturePickup
from gramoscope.player.learned import learned_of, pickup_of
from gramoscope.simulation.scene import filming_bench


def test_a_pickup_comes_back_as_it_was() -> None:
    cartridge = TextureLikelihood(filming_bench())
    layout = StripeLayout.of_bench(cartridge.bench, edge_margin_px=-16.0)
    pickup = TexturePickup(cartridge, layout, 123.0, (), {7: 2})
    back = pickup_of(cartridge, learned_of(pickup, ()))
    assert isinstance(back, TexturePickup)
    assert (back.layout, back.usual_sharpness, back.lessons, back.fold) == (layout, 123.0, (), {7: 2})
