!> The group `&horizon`: how far points interact, and how sums over families are corrected.
module pd_scene_groups_horizon
  use pd_base_kinds, only: wp
  use pd_scene_format_given, only: is_set, name_length, unset
  use pd_scene_format_keys, only: keys_type
  use pd_scene_groups_group, only: group_type
  implicit none (type, external)
  private
  public :: horizon_group

  !> `&horizon`
  type, extends(group_type) :: horizon_group
    real(wp) :: ratio = 3.015_wp                           !! delta over the largest spacing [-]
    real(wp) :: length = unset                             !! delta [m], instead of ratio
    logical :: local = .false.                             !! each point has its own
    character(name_length) :: volume_correction = 'linear' !! 'linear_extended', 'exact', 'none'
    character(name_length) :: surface_correction = 'energy'!! 'consistent', 'none'
    character(name_length) :: dilatation = ''              !! 'unprojected': Lambda = 1;
                                                           !! 'projected': as printed;
                                                           !! '' = by &scene defaults
    character(name_length) :: family = 'automatic'         !! 'lattice', 'list'
  contains
    procedure :: visit
  end type horizon_group

contains

  !> The keys of the group.
  subroutine visit(group, keys)
    class(horizon_group), intent(inout) :: group  !! its components are read or shown
    type(keys_type), intent(inout) :: keys        !! the visitor: reads, describes, writes

    call keys%key('ratio', group%ratio, '-', 'horizon over the spacing: of each lattice its '// &
      & 'own, of other bodies the largest one of the scene', at_least=1.0_wp, &
      & hidden=is_set(group%length))
    call keys%key('length', group%length, 'm', 'horizon delta of all points, instead of ratio', &
      & above=0.0_wp)
    call keys%key('local', group%local, 'each point has its own horizon: `ratio` times its '// &
      & 'spacing; bonds have the larger one of both ends')
    call keys%key('volume_correction', group%volume_correction, 'volumes of cells that the '// &
      & 'horizon cuts (7.2)', allowed=[character(15) :: 'linear', 'linear_extended', 'exact', &
      & 'none'])
    call keys%key('surface_correction', group%surface_correction, 'correction of points with '// &
      & 'incomplete families: energy (7.7); consistent: weights of bonds, exact under uniform '// &
      & 'strain', allowed=[character(10) :: 'energy', 'consistent', 'none'])
    call keys%key('dilatation', group%dilatation, 'unprojected: Lambda = 1, valid '// &
      & 'for any rotation; projected: Lambda as in the book, for small rotations (default '// &
      & 'of 0.1)', &
      & allowed=[character(11) :: 'unprojected', 'projected'], &
      & default="'unprojected'")
    call keys%key('family', group%family, &
      & 'how families are kept: a lattice where all points lie on grids, else lists, and both '// &
      & 'where grids meet; or one of them on request', &
      & allowed=[character(9) :: 'automatic', 'lattice', 'list'])
  end subroutine visit

end module pd_scene_groups_horizon
